"""Other compilers, flags and widths on the same generated text: does any make the lanes faster?"""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from lane_parts import Alone, Part, timing_text
from passiflex.native.compiler import FLAGS, find_compiler

INLINED = r"INLINE(?= lanes lanes_(?:sin|cos|exp|tanh)\()"


class Variant(NamedTuple):
    """A way to compile: command with its flags, the number of lanes (by the processor if None).

    `called`: sin, cos, exp and tanh are functions of their own, and not repeated wherever they are used.
    """

    name: str
    command: tuple[str, ...]
    width: int | None = None
    called: bool = False


class Tried(NamedTuple):
    """One variant: seconds to compile, and of one call per lane, the best of several by turns [s]."""

    name: str
    compiled_in: float
    per_lane: dict[str, float]


def variants() -> list[Variant]:
    """Return what can be tried here, the package's own way first."""
    compiler = find_compiler()
    assert compiler is not None
    own = (*compiler.argv, *compiler.flags)
    found = [
        Variant("as the package does", own),
        Variant("sin, cos, exp, tanh called", own, called=True),
        Variant("-Os", (*own, "-Os")),
        Variant("-Os, sin … called", (*own, "-Os"), called=True),
        Variant("-O3", (*own, "-O3")),
        Variant("-O1", (*own, "-O1")),
        Variant("scheduled for registers", (*own, "-fschedule-insns", "-fsched-pressure")),
        Variant("not scheduled", (*own, "-fno-schedule-insns2")),
        Variant("4 lanes", own, 4),
        Variant("4 lanes, sin … called", own, 4, called=True),
        Variant("16 lanes, two registers each", own, 16),
    ]
    if importlib.util.find_spec("ziglang") is not None:
        zig = (sys.executable, "-m", "ziglang", "cc", "-mcpu=native", *FLAGS)
        found += [
            Variant("clang (zig cc)", zig),
            Variant("clang (zig cc), sin … called", zig, called=True),
        ]
    return found


def tried(parts: list[Part], folder: Path, calls: int, repeats: int) -> list[Tried]:
    """Compile the parts in every way, and time them by turns; a way that fails is left out."""
    made: list[tuple[str, float, Alone]] = []
    for number, variant in enumerate(variants()):
        text, library = folder / f"{number}.c", folder / f"{number}.so"
        source = timing_text(parts, variant.width)
        text.write_text(re.sub(INLINED, "ALONE", source) if variant.called else source, encoding="utf-8")
        begun = time.perf_counter()
        command = [*variant.command, str(text), "-o", str(library), "-lm"]
        if subprocess.run(command, capture_output=True, check=False).returncode == 0:
            made.append((variant.name, time.perf_counter() - begun, Alone(library, parts)))
    best: dict[str, dict[str, float]] = {name: {} for name, _, _ in made}
    for _ in range(repeats):
        for name, _, alone in made:
            for part in parts:
                took = alone.seconds(part.name, calls) / alone.width
                best[name][part.name] = min(took, best[name].get(part.name, took))
    return [Tried(name, compiled_in, best[name]) for name, compiled_in, _ in made]
