"""The bundle of the viewer: where it is missing or does not fit into a page, the message says what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from passiflex.reports import ViewerError
from passiflex.reports import viewer as viewer_module
from passiflex.reports.viewer import FILES, read_viewer
from reports.pages import VIEWER

BUNDLE = Path(viewer_module.__file__).parent / "bundle"


def built(folder: Path, monkeypatch: pytest.MonkeyPatch, **changes: str) -> None:
    """Make a package whose reports have this bundle."""
    (folder / "bundle").mkdir()
    for name, text in zip(FILES, VIEWER._replace(**changes), strict=True):
        (folder / "bundle" / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(viewer_module.resources, "files", lambda package: folder)


def test_the_bundle_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built(tmp_path, monkeypatch)
    assert read_viewer() == VIEWER


def test_a_bundle_that_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer_module.resources, "files", lambda package: tmp_path)
    with pytest.raises(ViewerError) as caught:
        read_viewer()
    assert str(caught.value) == (
        "the viewer of reports is not built; got no readable viewer.js, viewer.css, THIRD_PARTY.txt in "
        "passiflex/reports/bundle (FileNotFoundError); needs the bundle that every wheel of passiflex has; "
        "try `python hatch_build.py` in a checkout, or installing passiflex from a wheel"
    )


@pytest.mark.parametrize(
    ("part", "text"),
    [
        ("script", "a = '</SCRIPT>'"),
        ("script", "a = '<!--'"),
        ("style", "</style>"),
        ("licences", "</script>"),
    ],
)
def test_a_bundle_that_would_end_its_element(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str, text: str
) -> None:
    built(tmp_path, monkeypatch, **{part: text})
    with pytest.raises(
        ViewerError, match=rf"the viewer's {part} cannot stand inside a page; got .*; try build"
    ):
        read_viewer()


@pytest.mark.skipif(not BUNDLE.is_dir(), reason="the viewer is not built")
def test_the_bundle_of_the_package_fits_into_a_page() -> None:
    assert all(len(part) > 100 for part in read_viewer())
