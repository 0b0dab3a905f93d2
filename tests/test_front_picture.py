"""The README's picture is what its script makes of a run of today's package."""

from __future__ import annotations

import importlib
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docs" / "front.svg"
NUMBER = re.compile(r"-?(?:\d+\.?\d*|\.\d+)")
ROUNDED = 0.21
"""Numbers are written to a tenth of a pixel; on another machine either end of a step may round elsewhere."""


def taken_apart(svg: str) -> tuple[str, np.ndarray]:
    """Return what stands around the numbers of a picture, and the numbers."""
    return NUMBER.sub("#", svg), np.array([float(number) for number in NUMBER.findall(svg)])


def test_the_picture_is_of_this_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs")
    around, numbers = taken_apart(importlib.import_module("front_picture").picture())
    kept_around, kept = taken_apart(FILE.read_text(encoding="utf-8"))
    assert kept_around == around, "the picture is an old one: make front"
    assert np.abs(kept - numbers).max() <= ROUNDED, "the picture shows another run: make front"


def test_the_picture_is_small_and_asks_for_nothing() -> None:
    text = FILE.read_text(encoding="utf-8")
    assert len(text) < 40_000
    ids = {element.get("id") for element in ET.fromstring(text).iter()}
    links = re.findall(r'(?:href="|url\()([^")]+)', text)
    assert {link.removeprefix("#") for link in links} <= ids
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
    assert "<script" not in text


def test_the_readme_and_the_first_page_open_with_it() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert 'src="docs/front.svg"' in readme.partition("\n## ")[0]
    assert "{figure} front.svg" in (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
