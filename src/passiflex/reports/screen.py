"""Opening a page where somebody can see it."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path

TEXT_BROWSERS = ("www-browser", "links", "elinks", "lynx", "w3m")
"""They would take over the terminal, and draw nothing."""


def has_screen() -> bool:
    """Return whether a window can be opened."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_in_browser(path: Path) -> bool:
    """Open a file in a browser with windows, and return whether there was a screen and such a browser."""
    if not has_screen():
        return False
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    if Path(str(getattr(browser, "name", ""))).name in TEXT_BROWSERS:
        return False
    return browser.open(path.resolve().as_uri())
