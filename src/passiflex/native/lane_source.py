"""CasADi functions as C for several lanes: one instruction stream that advances several robots side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as cs

from passiflex.errors import ValueRangeError
from passiflex.native.library import c_source

WIDTHS = (1, 2, 4, 8)

_NAMES = {value: name[3:].lower() for name, value in vars(cs).items() if name.startswith("OP_")}
_BETWEEN = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_WRITTEN: dict[str, Callable[[str], str]] = {
    "assign": lambda a: a,
    "neg": lambda a: f"-{a}",
    "sq": lambda a: f"{a} * {a}",
    "twice": lambda a: f"{a} + {a}",
    "inv": lambda a: f"1.0 / {a}",
}
_CALLED = frozenset({
    "lt", "le", "eq", "ne", "not", "and", "or", "if_else_zero", "fabs", "sign", "fmin", "fmax", "sqrt", "floor",
    "ceil", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh", "tanh", "erf", "atan2",
    "pow", "constpow", "fmod", "copysign", "hypot",
})  # fmt: skip
_OTHER_NAME = {"constpow": "pow"}


def lane_source(functions: Sequence[cs.Function], width: int | None = None) -> str:
    """Return C text with `NAME_in_lanes(const lanes* x0, …, lanes* y0, …)` for each function.

    Inputs and outputs are dense columns, one vector of lanes for each number. The text begins with
    `lanes.h`; `width` lanes are compiled, by the processor if it is None. What several quotients divide by
    is inverted once: they then differ in the last place, and below 1e-308 altogether.

    Raises
    ------
    ValueRangeError
        For a function that is not straight-line (made of SX), or uses what `lanes.h` has not; for a width
        that no register has.
    """
    if width not in (None, *WIDTHS):
        raise ValueRangeError("number of lanes", got=width, needs="one of " + ", ".join(map(str, WIDTHS)))
    chosen = "" if width is None else f"#define LANES {width}\n"
    return "\n".join((chosen + c_source("lanes.h"), *map(_function, functions)))


def _function(f: cs.Function) -> str:
    if not f.is_a("SXFunction"):
        raise ValueRangeError(f"function {f.name()!r} cannot run in lanes", got=f.class_name(), needs="SX")
    inputs = [f"const lanes* restrict x{i}" for i in range(f.n_in())]
    outputs = [f"lanes* restrict y{i}" for i in range(f.n_out())]
    steps = [
        _Step(_NAMES[f.instruction_id(k)], f.instruction_output(k), f.instruction_input(k))
        for k in range(f.n_instructions())
    ]
    shared = _shared_divisors(steps)
    lines = [f"ALONE void {f.name()}_in_lanes({', '.join(inputs + outputs)})", "{"]
    lines += [f"    lanes {', '.join(f'w{i}' for i in range(f.sz_w()))};"] * bool(f.sz_w())
    for k, step in enumerate(steps):
        constant = f.instruction_constant(k) if step.op == "const" else 0.0
        lines += [f"    {text};" for text in _statements(f.name(), k, step, shared, constant)]
    return "\n".join((*lines, "}"))


class _Step(NamedTuple):
    """One instruction: operation, where its result goes, and what it is made of; numbers of work variables."""

    op: str
    to: list[int]
    of: list[int]


def _shared_divisors(steps: Sequence[_Step]) -> dict[int, tuple[int, bool]]:
    """Return for each division by something that is divided by more than once: the first such, and whether it is it.

    A work variable is written many times; what it held is known by the instruction that wrote it.
    """
    writer: dict[int, int] = {}
    divisions: dict[int, list[int]] = {}
    for k, step in enumerate(steps):
        if step.op in ("div", "inv"):
            divisions.setdefault(writer[step.of[-1]], []).append(k)
        if step.op != "output":
            writer[step.to[0]] = k
    return {k: (same[0], k == same[0]) for same in divisions.values() if len(same) > 1 for k in same}


def _statements(
    name: str, k: int, step: _Step, shared: dict[int, tuple[int, bool]], constant: float
) -> list[str]:
    """Return instruction k in C; work variable i is `wi`, the inverse of what instruction j divides by `rj`."""
    op, to, of = step
    if op == "input":
        return [f"w{to[0]} = x{of[0]}[{of[1]}]"]
    if op == "output":
        return [f"y{to[0]}[{to[1]}] = w{of[0]}"]
    if op == "const":
        return [f"w{to[0]} = all_lanes({_number(constant)})"]
    a = [f"w{i}" for i in of]
    if k in shared:
        first, here = shared[k]
        inverse = [f"const lanes r{first} = 1.0 / {a[-1]}"] * here
        return [*inverse, f"w{to[0]} = {f'{a[0]} * ' * (op == 'div')}r{first}"]
    if op in _BETWEEN:
        return [f"w{to[0]} = {a[0]} {_BETWEEN[op]} {a[1]}"]
    if op in _WRITTEN:
        return [f"w{to[0]} = {_WRITTEN[op](a[0])}"]
    if op not in _CALLED:
        raise ValueRangeError(
            f"function {name!r} cannot run in lanes", got=f"operation {op!r}", needs="one that lanes.h has"
        )
    return [f"w{to[0]} = lanes_{_OTHER_NAME.get(op, op)}({', '.join(a)})"]


def _number(value: float) -> str:
    """Return a constant in C, exact."""
    if value != value:
        return "NAN"
    if value in (float("inf"), float("-inf")):
        return "INFINITY" if value > 0 else "-INFINITY"
    return value.hex()
