"""A page is opened where there is a screen, and never by a browser of text."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from types import SimpleNamespace

import pytest

from passiflex.reports import open_in_browser
from passiflex.reports.screen import TEXT_BROWSERS, has_screen


class Browser(SimpleNamespace):
    """Keeps what it was asked to open."""

    def open(self, address: str) -> bool:
        self.opened.append(address)
        return True


def install(monkeypatch: pytest.MonkeyPatch, name: str) -> Browser:
    browser = Browser(name=name, opened=[])
    monkeypatch.setattr(webbrowser, "get", lambda: browser)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("DISPLAY", ":0")
    return browser


def test_a_page_is_opened_by_its_address(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    browser = install(monkeypatch, "firefox")
    assert open_in_browser(tmp_path / "a run.html")
    assert browser.opened == [f"{tmp_path.as_uri()}/a%20run.html"]


@pytest.mark.parametrize("name", TEXT_BROWSERS)
def test_a_browser_of_text_is_not_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str) -> None:
    browser = install(monkeypatch, f"/usr/bin/{name}")
    assert not open_in_browser(tmp_path)
    assert browser.opened == []


def test_no_browser_at_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, "firefox")

    def none() -> None:
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "get", none)
    assert not open_in_browser(tmp_path)


@pytest.mark.parametrize(
    ("platform", "variables", "there"),
    [
        ("linux", {}, False),
        ("linux", {"DISPLAY": ""}, False),
        ("linux", {"DISPLAY": ":0"}, True),
        ("linux", {"WAYLAND_DISPLAY": "wayland-0"}, True),
        ("darwin", {}, True),
        ("win32", {}, True),
    ],
)
def test_where_there_is_a_screen(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, platform: str, variables: dict[str, str], there: bool
) -> None:
    browser = install(monkeypatch, "firefox")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.platform", platform)
    assert has_screen() == there
    assert open_in_browser(tmp_path) == there
    assert bool(browser.opened) == there
