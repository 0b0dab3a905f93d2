"""The XML of a URDF document: its elements that are read, whatever else the document holds."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

from passiflex.errors import RobotError
from passiflex.texts.quantity import shown
from passiflex.texts.text_file import IN_XML, UnreadableError, decoded, read_bytes

MOST_BYTES = 10_000_000
MOST_ELEMENTS = 200_000
READ = {
    "robot": ("link", "joint"),
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
"""Element → what of its content is read. Of other content its name and those of its attributes are kept, no more."""
LEAVES = ("origin", "axis", "limit", "mass", "inertia", "parent", "child")
"""Elements whose attributes are read; of text in them it is kept that there is some."""
ATTRIBUTES = {
    "robot": ("name", "version"),
    "link": ("name",),
    "joint": ("name", "type"),
    "parent": ("link",),
    "child": ("link",),
    "mimic": ("joint",),
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "velocity", "effort"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
"""Element → attributes that are read."""
_DECLARATION = re.compile(r"\A[\s\ufeff]*<\?xml\s[^>]{0,200}\?>")
_TEMPLATE = re.compile(r"\$[{(]")


def read_xml(source: str | Path) -> tuple[str, ET.Element]:
    """Return what a URDF document is to be called in errors, and its root.

    Names are as they are written: as in the readers of other tools, a default namespace changes nothing, and a
    prefix needs no declaration.

    Raises
    ------
    RobotError
        If `source` is neither a text with a `<` nor the path of a readable file, or not the XML of a URDF.
    """
    name, text = _text(source)
    reader = _Reader(name)
    parser = expat.ParserCreate()
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.characters
    parser.StartDoctypeDeclHandler = reader.doctype
    # The text is decoded already, and may stand behind blank lines: its declaration has nothing more to say.
    data = _DECLARATION.sub(lambda m: re.sub(r"\S|\ufeff", " ", m[0]), text).encode("utf-8", "surrogatepass")
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        if data[parser.ErrorByteIndex :].startswith((b"<!DOCTYPE", b"<!ENTITY")):
            reader.doctype()
        got = expat.ErrorString(error.code) + f", column {error.offset + 1}"
        try_ = None
        if Path(name).suffix in (".yaml", ".yml"):
            try_ = "FlexibleJointRobot.load for a robot file, which names its URDF"
        what = f"{name} is not well-formed XML, line {error.lineno}"
        raise RobotError(what, got=got, needs="URDF", try_=try_) from None
    assert reader.root is not None
    return name, reader.root


def _text(source: Any) -> tuple[str, str]:
    """Return what a document is to be called, and its text."""
    if isinstance(source, str) and "<" in source:
        if len(source) > MOST_BYTES:
            raise RobotError(
                "the URDF text is too long", got=f"{len(source)} characters", needs=f"{MOST_BYTES}"
            )
        return "the URDF text", source
    if not isinstance(source, str | Path) or not str(source).strip():
        raise RobotError(
            "no URDF document",
            got=shown(source),
            needs="its text, or the path of its file",
            try_=None
            if isinstance(source, str) or not source
            else "the text: .decode() of bytes, .read() of a file",
        )
    try:
        return str(source), decoded(read_bytes(Path(source), MOST_BYTES), IN_XML)
    except UnreadableError as error:
        what = f"the URDF file {str(source)!r} cannot be read"
        try_ = None
        if str(error).endswith(" text"):
            try_ = 'naming its encoding in its first line, as <?xml version="1.0" encoding="ISO-8859-1"?>'
        raise RobotError(what, got=error, needs="a text file", try_=try_) from None


class _Reader:
    """The elements that are read, from the events of a parser."""

    def __init__(self, name: str):
        self.name = name
        self.root: ET.Element | None = None
        self.open: list[ET.Element] = []
        self.outside = 0  # how deep in what is not read
        self.elements = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take the beginning of an element."""
        self.elements += 1
        if self.elements > MOST_ELEMENTS:
            raise RobotError(f"{self.name} is too large", got=f"more than {MOST_ELEMENTS} elements")
        if self.root is None:
            if tag != "robot":
                raise RobotError(
                    f"{self.name} is not a URDF document", got=f"root <{tag[:60]}>", needs="root <robot>"
                )
            self.root = ET.Element(tag, attributes)
            self.open.append(self.root)
            self._refuse_template(tag, attributes)
        elif self.outside:
            self.outside += 1
        elif tag in READ.get(self.open[-1].tag, ()):
            self._refuse_template(tag, attributes)
            self.open.append(ET.SubElement(self.open[-1], tag, attributes))
        else:
            self._refuse_template(tag, {})
            ET.SubElement(self.open[-1], tag, dict.fromkeys(attributes, ""))
            self.outside = 1

    def end(self, tag: str) -> None:
        """Take the end of an element."""
        if self.outside:
            self.outside -= 1
        else:
            self.open.pop()

    def characters(self, text: str) -> None:
        """Take text."""
        if not self.outside and self.open[-1].tag in LEAVES and not self.open[-1].text and text.strip():
            self.open[-1].text = text.strip()

    def doctype(self, *_: Any) -> NoReturn:
        """Refuse what could name other files, or entities that grow."""
        raise RobotError(f"{self.name} has a DOCTYPE or entities", needs="plain XML", try_="removing them")

    def _refuse_template(self, tag: str, attributes: dict[str, str]) -> None:
        """Raise RobotError for a document that has to be expanded before there are numbers in it."""
        read = (attributes.get(name, "") for name in ATTRIBUTES.get(tag, ()))
        if tag.startswith("xacro:") or any(_TEMPLATE.search(value) for value in read):
            try_ = "expanding it first: xacro FILE > arm.urdf"
            raise RobotError(f"{self.name} is a xacro template", needs="plain URDF", try_=try_)
