"""A compiled law as C text: its functions without anything around them, and structs from its declarations."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.layout import Field, Layout
from passiflex.parts import Parts

Array = NDArray[np.float64]

_HELPER = re.compile(r"^(casadi_real|casadi_int|void) (casadi_\w+\()", re.MULTILINE)
_BODY = re.compile(
    r"^/\* \w+:\([^\n]*\n(?=static int casadi_f)|^static int casadi_f\d+\(.*?^}\n", re.MULTILINE | re.DOTALL
)
_CALLED = r"int {name}\(const casadi_real\*\* arg[^{{]*{{\s*return (casadi_f\d+)\("
_UNUSED = "  (void)iw; (void)w; (void)mem;\n"


def functions_text(functions: Mapping[str, cs.Function]) -> str:
    """Return C99 text of functions, all static, and macros NAME(arg, res) that call them."""
    generator = cs.CodeGenerator(
        "pf_law", {"with_header": False, "casadi_int": "long long int", "casadi_real": "double"}
    )
    for function in functions.values():
        generator.add(function)
    text = generator.dump()
    head, rest = text.split("/* Symbol visibility in DLLs */")
    helpers = rest.split("#endif\n\n", 1)[1].split("/* Configuration this file was compiled with */")[0]
    helpers = _HELPER.sub(r"static \1 \2", helpers)
    bodies = "\n".join(found.replace("mem) {\n", f"mem) {{\n{_UNUSED}", 1) for found in _BODY.findall(rest))
    macros = []
    for name, function in functions.items():
        called = re.search(_CALLED.format(name=function.name()), rest)
        assert called is not None
        macros.append(f"#define {name}(arg, res) {called[1]}(arg, res, NULL, NULL, 0)")
    return "\n".join(["#include <stddef.h>", head.strip(), helpers.strip(), bodies, *macros, ""])


def struct_text(name: str, what: str, layout: Layout) -> str:
    """Return a struct of a layout: numbers alone, in its order, each with unit and meaning."""
    return "\n".join([f"/* {what} */", "typedef struct {", *_members(layout, "    "), f"}} {name};", ""])


def parts_text(name: str, what: str, parts: Parts) -> str:
    """Return a struct of the layouts of parts."""
    lines = [f"/* {what} */", "typedef struct {"]
    for part, layout in parts.layouts.items():
        if layout.size:
            lines += ["    struct {", *_members(layout, "        "), f"    }} {part};"]
    return "\n".join([*lines, f"}} {name};", ""])


def values_text(parts: Parts, numbers: Array) -> str:
    """Return the values of a struct of parts."""
    lines = []
    for part, layout in parts.layouts.items():
        if layout.size:
            values = layout.unpack(numbers[parts.slices[part]])
            lines += [
                f"    .{part} = {{",
                *(f"        .{f.name} = {listed(values[f.name])}," for f in layout),
            ]
            lines.append("    },")
    return "\n".join(lines)


def listed(value: Array) -> str:
    """Return numbers as C initialises them, to the last bit."""
    if value.ndim:
        return "{" + ", ".join(listed(v) for v in value) + "}"
    return repr(float(value))


def _members(layout: Layout, indent: str) -> Iterator[str]:
    for f in layout:
        if f.size:
            yield f"{indent}double {f.name}{_shape(f)}; /* {f.unit}: {f.meaning} */"


def _shape(f: Field) -> str:
    return "".join(f"[{size}]" for size in f.shape)
