"""A real browser, driven over its DevTools protocol in real time, with a report opened from a file."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from matplotlib.image import imread
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Locator, Page, Playwright, Request

QUIET = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
SOFTWARE_WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_WEBGL = ("--disable-gpu", "--disable-3d-apis")
DESKTOP = (1280, 720)
CANVAS = 'canvas[role="img"]'
"""The picture of the arm."""
PATIENCE = 20_000
"""Longest wait for anything on the page [ms]."""
OWN = ("file:", "data:", "blob:")
"""Addresses that reach no network."""


def executable() -> str:
    """Return the browser's path; without one the tests are skipped, and fail where CI must have it."""
    found = os.environ.get("PASSIFLEX_BROWSER") or shutil.which("chromium")
    if found is None:
        reason = "no chromium here: `make browser` installs it, PASSIFLEX_BROWSER names another"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@contextmanager
def started(playwright: Playwright, *flags: str) -> Iterator[Browser]:
    """Run a browser with flags beside the quiet ones."""
    browser = playwright.chromium.launch(executable_path=executable(), args=[*QUIET, *flags])
    try:
        yield browser
    finally:
        browser.close()


class Rectangle(NamedTuple):
    """A part of the page [px]."""

    left: float
    top: float
    width: float
    height: float

    @property
    def right(self) -> float:
        return self.left + self.width

    @property
    def bottom(self) -> float:
        return self.top + self.height


class Report:
    """An open report: what its page did wrong, and what it shows.

    Attributes
    ----------
    errors: Errors of scripts and of the console, and warnings of the page's own policy.
    requests: Addresses asked for, beside the file itself.
    """

    def __init__(self, context: BrowserContext, path: Path, fragment: str = ""):
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.page: Page = context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.page.on("console", self._said)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", self._asked)
        self.page.goto(path.resolve().as_uri() + fragment)
        self.page.wait_for_function("() => window.passiflex && window.passiflex.header")

    def _said(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def _asked(self, request: Request) -> None:
        if not request.url.startswith(OWN):
            self.requests.append(request.url)

    def call(self, name: str, *arguments: object) -> Any:
        """Call a function of `window.passiflex`."""
        return self.page.evaluate(
            "([name, given]) => window.passiflex[name](...given)", [name, list(arguments)]
        )

    def at(self, time: float) -> None:
        """Seek, and wait until the page has drawn it."""
        self.call("seek", time)
        self.drawn()

    def drawn(self) -> None:
        """Wait for the next pictures of the page."""
        frames = "() => new Promise(go => requestAnimationFrame(() => requestAnimationFrame(() => go(true))))"
        self.page.evaluate(frames)

    @property
    def header(self) -> dict[str, Any]:
        return dict(self.page.evaluate("() => window.passiflex.header"))

    def label(self, kind: str, choice: str, role: str) -> str:
        """Return the name of the curve of a role."""
        return next(
            curve["label"]
            for panel in self.header["panels"]
            for curve in panel["curves"]
            if (panel["kind"], panel["choice"], curve["role"]) == (kind, choice, role)
        )

    def plot(self, kind: str) -> Rectangle:
        """Return where the curves of a diagram are drawn."""
        return self.rectangle(f'section[aria-label="{kind} over time"] .u-over')

    def shown_times(self) -> tuple[float, float]:
        """Return the stretch of time that the diagrams show [s]."""
        start, end = self.page.evaluate("() => window.passiflex.shownTimes()")
        return start, end

    def rectangle(self, selector: str) -> Rectangle:
        """Return where the first such element is."""
        box = self.page.locator(selector).first.bounding_box()
        assert box is not None, f"{selector} is not to be seen"
        return Rectangle(box["x"], box["y"], box["width"], box["height"])

    def choose(self, kind: str, choice: str) -> None:
        """Choose one of the diagrams that share a place."""
        self.page.get_by_label(f"which {kind} diagram").select_option(label=f"{kind}: {choice}")
        self.drawn()

    def legend(self, kind: str) -> dict[str, str]:
        """Return the values written beside a diagram, by curve."""
        rows = self.page.locator(f'section[aria-label="{kind} over time"] .legend li')
        return {row.locator(".name").inner_text(): row.locator(".value").inner_text() for row in rows.all()}

    def button(self, label: str) -> Locator:
        """Return the button whose label holds these words."""
        return self.page.get_by_role("button", name=label)

    def pixels(self, part: Rectangle) -> np.ndarray:
        """Return what a part of the page looks like: (height, width, 3), 0 to 255."""
        clip = {"x": part.left, "y": part.top, "width": part.width, "height": part.height}
        picture = imread(BytesIO(self.page.screenshot(clip=clip)), format="png")
        return np.rint(picture[:, :, :3] * 255).astype(np.uint8)

    def scene(self) -> np.ndarray:
        """Return the middle of the picture of the arm, where no words lie over it."""
        whole = self.rectangle(CANVAS)
        return self.pixels(
            Rectangle(
                whole.left + 0.3 * whole.width,
                whole.top + 0.25 * whole.height,
                0.4 * whole.width,
                0.4 * whole.height,
            )
        )

    def keep(self, name: str) -> None:
        """Take a picture of the page into the folder PASSIFLEX_SHOTS, for people to look at."""
        if folder := os.environ.get("PASSIFLEX_SHOTS"):
            Path(folder).mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=Path(folder) / f"{name}.png")


def number(text: str) -> float:
    """Return the number that a person reads, without its unit; a dash is a gap."""
    word = text.split()[0].replace("\N{MINUS SIGN}", "-")
    return float("nan") if word == "\N{EN DASH}" else float(word)


def colours(pixels: np.ndarray) -> int:
    """Return how many colours there are."""
    return len(np.unique(pixels.reshape(-1, 3), axis=0))
