"""The viewer of a page: script, style and licences, as the package's build bundles them from `web/`."""

from __future__ import annotations

from importlib import resources
from typing import NamedTuple

from passiflex.errors import PassiflexError

FORBIDDEN = {"script": ("</script", "<!--"), "style": ("</style",), "licences": ("</script", "<!--")}
"""What would end the element of a page that holds a part, or begin a comment in it."""


class ViewerError(PassiflexError):
    """The viewer of reports is not there, or does not fit into a page."""


class Viewer(NamedTuple):
    """The texts of the bundle."""

    script: str
    style: str
    licences: str


FILES = Viewer("viewer.js", "viewer.css", "THIRD_PARTY.txt")


def read_viewer() -> Viewer:
    """Return the bundle.

    Raises
    ------
    ViewerError
        If it was not built, or cannot stand inside a page.
    """
    bundle = resources.files("passiflex.reports") / "bundle"
    try:
        viewer = Viewer(*((bundle / name).read_text(encoding="utf-8") for name in FILES))
    except (OSError, UnicodeDecodeError) as error:
        raise ViewerError(
            "the viewer of reports is not built",
            got=f"no readable {', '.join(FILES)} in passiflex/reports/bundle ({type(error).__name__})",
            needs="the bundle that every wheel of passiflex has",
            try_="`python hatch_build.py` in a checkout, or installing passiflex from a wheel",
        ) from error
    for part, text in viewer._asdict().items():
        found = [mark for mark in FORBIDDEN[part] if mark in text.lower()]
        if found:
            raise ViewerError(
                f"the viewer's {part} cannot stand inside a page", got=found[0], try_="building it again"
            )
    return viewer
