"""What is read as text: by xml.etree and by the YAML standard where a file says its encoding, and nothing else."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import yaml

from passiflex.texts.text_file import IN_XML, IN_YAML, UnreadableError, decoded, read_bytes

WORD = "Drehgelenk für Größe"


@pytest.mark.parametrize(
    "encoding",
    [
        "utf-8",
        "ISO-8859-1",
        "latin-1",
        "windows-1252",
        "cp1250",
        "ISO-8859-15",
        "macintosh",
        "us-ascii",
    ],
)
@pytest.mark.parametrize("quote", "\"'")
def test_a_declared_encoding_is_read_as_the_standard_library_reads_it(encoding: str, quote: str) -> None:
    word = WORD if encoding != "us-ascii" else "Drehgelenk"
    data = f"<?xml version={quote}1.0{quote} encoding={quote}{encoding}{quote}?>\n<r n='{word}'/>".encode(
        encoding
    )
    text = decoded(data, IN_XML)
    assert ET.fromstring(data).get("n") == word
    assert word in text


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig"])
@pytest.mark.parametrize("declares", ["", "utf-8", "utf-16", "Unicode"])
def test_a_byte_order_mark_or_the_zeros_of_ascii_come_before_a_declaration(
    encoding: str, declares: str
) -> None:
    head = f'<?xml version="1.0" encoding="{declares}"?>' if declares else ""
    text = f"{head}<r n='{WORD}'/>"
    assert decoded(text.encode(encoding), IN_XML) == text


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_yaml_is_read_as_pyyaml_reads_bytes(encoding: str) -> None:
    data = f"name: {WORD}\n".encode(encoding)
    assert yaml.safe_load(decoded(data, IN_YAML)) == yaml.safe_load(data) == {"name": WORD}


def test_a_yaml_file_may_name_its_encoding_as_editors_do() -> None:
    text = f"# -*- coding: latin-1 -*-\nname: {WORD}\n"
    assert decoded(text.encode("latin-1"), IN_YAML) == text
    with pytest.raises(UnreadableError, match="not UTF-8 text"):
        decoded(f"# encoding: that of the robot\nname: {WORD}\n".encode("latin-1"), IN_YAML)


def test_a_declaration_that_the_bytes_themselves_refute_is_not_believed() -> None:
    """Saved again as UTF-8 by an editor that leaves the first line alone."""
    text = f'<?xml version="1.0" encoding="UTF-16"?><r n="{WORD}"/>'
    assert decoded(text.encode(), IN_XML) == text


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'<?xml version="1.0" encoding="klingon"?><r/>', "unknown encoding 'klingon'; save it as UTF-8"),
        (b'<?xml version="1.0" encoding="punycode"?><r/>', "unknown encoding 'punycode'; save it as UTF-8"),
        (
            b'<?xml version="1.0" encoding="unicode_escape"?><r/>',
            "unknown encoding 'unicode_escape'; save it as UTF-8",
        ),
        (b'<?xml version="1.0" encoding="rot13"?><r/>', "unknown encoding 'rot13'; save it as UTF-8"),
        (b'<?xml version="1.0" encoding="cp1252"?><r n="\x81"/>', "not cp1252 text"),
        (b"<r n='\xfc'/>", "not UTF-8 text"),
        (b"\xff\xfea", "not UTF-16 text"),
        (b"\xff\xfe\x00\xd8", "not UTF-16 text"),
    ],
)
def test_bytes_that_are_not_in_their_encoding_are_refused(data: bytes, message: str) -> None:
    with pytest.raises(UnreadableError) as error:
        decoded(data, IN_XML)
    assert str(error.value) == message


def test_only_regular_files_of_bearable_size_are_opened(tmp_path: Path) -> None:
    (tmp_path / "good").write_bytes(b"abc")
    (tmp_path / "link").symlink_to("good")
    assert read_bytes(tmp_path / "link", 3) == b"abc"
    os.mkfifo(tmp_path / "pipe")  # whoever opens it waits for the other end
    (tmp_path / "zero").symlink_to("/dev/zero")
    for path, message in {
        tmp_path / "good": "larger than 2e-06 MB",
        tmp_path / "pipe": "not a regular file",
        tmp_path / "zero": "not a regular file",
        tmp_path / "none": "No such file or directory",
        tmp_path / "a\0b": "embedded null byte",
        tmp_path: "Is a directory",
    }.items():
        with pytest.raises(UnreadableError, match=f"^{message}$"):
            read_bytes(path, 2)


def test_a_file_of_the_kernel_is_empty() -> None:
    """Their sizes are zero, and the reading of some has no end."""
    assert read_bytes(Path("/proc/self/status")) == b""
