"""How much arithmetic one period of the sampled loop is: counted in the C text that runs in lanes."""

from __future__ import annotations

import re
from collections import Counter
from typing import NamedTuple

import casadi as cs

from passiflex.native.lane_source import lane_source


class Ops(NamedTuple):
    """Operations of one call, each on one vector.

    Attributes
    ----------
    adds, multiplies: + and −; ×. Those of the polynomials of sin, cos, exp and tanh included.
    joined: Pairs of a product and the sum that alone uses it: one multiply-add instruction.
    divisions, roots: The slow ones, tanh's division included.
    polynomials: Calls of sin, cos, exp and tanh.
    library: Calls of the C library, lane by lane.
    logic: Comparisons, selections, signs, least and largest, floor.
    """

    adds: float
    multiplies: float
    joined: float
    divisions: float
    roots: float
    polynomials: float
    library: float
    logic: float

    @property
    def issued(self) -> float:
        """Return how many instructions +, − and × need at least."""
        return self.adds + self.multiplies - self.joined

    def times(self, count: float) -> Ops:
        return Ops(*(count * v for v in self))

    def plus(self, other: Ops) -> Ops:
        return Ops(*(a + b for a, b in zip(self, other, strict=True)))


# What lanes.h makes of one call: +, ×, joined, ÷, then what is logic. Sine and cosine are both evaluated.
_COSTS = {
    "sin": Ops(20, 23, 18, 0, 0, 1, 0, 9),
    "cos": Ops(20, 23, 18, 0, 0, 1, 0, 8),
    "exp": Ops(17, 17, 15, 0, 0, 1, 0, 6),
    "tanh": Ops(19, 18, 15, 1, 0, 1, 0, 9),
}
_LIBRARY = {
    "tan", "asin", "acos", "atan", "log", "sinh", "cosh", "erf", "atan2", "pow", "fmod", "copysign", "hypot",
}  # fmt: skip
_NONE = Ops(*[0.0] * 8)


_LATENCY = {"+": 4, "-": 4, "*": 4, "/": 24, "sqrt": 32, "sin": 60, "cos": 60, "exp": 70, "tanh": 100}
"""Cycles until a result can be used, of recent processors; 1 for all others."""


def statements(function: cs.Function) -> list[tuple[str, str, str, str]]:
    """Return (target, its index if it is an output, right-hand side, kind) of each statement."""
    found = re.findall(r"^    (?:const lanes )?(\w+)(\[\d+\])? = (.*);$", lane_source([function]), re.M)
    return [(to, index, what, _kind(what)) for to, index, what in found]


def _kind(what: str) -> str:
    called, sign = re.match(r"lanes_(\w+)\(", what), re.search(r" ([+*/-]) ", what)
    return called[1] if called else sign[1] if sign else "sign" if what.startswith("-") else ""


def longest_chain(function: cs.Function) -> int:
    """Return the cycles of the longest chain of results that wait for each other."""
    ready: dict[str, int] = {}
    for to, _, what, kind in statements(function):
        begin = max((ready.get(name, 0) for name in re.findall(r"\b[wr]\d+\b", what)), default=0)
        ready[to] = begin + (_LATENCY.get(kind, 1) if kind else 0)
    return max(ready.values())


def operations(function: cs.Function) -> Ops:
    """Return the operations of one call."""
    total = _NONE
    products: dict[str, int] = {}  # work variable → number of the product that it holds
    uses: Counter[int] = Counter()
    in_sums: dict[int, set[int]] = {}  # product → sums that use it
    for k, (to, index, what, kind) in enumerate(statements(function)):
        for name in re.findall(r"\b[wr]\d+\b", what):
            if name in products:
                uses[products[name]] += 1
                if kind in ("+", "-"):
                    in_sums.setdefault(products[name], set()).add(k)
        if kind:
            total = total.plus(_cost(kind))
        if not index:
            products.pop(to, None)
            if kind == "*":
                products[to] = k
    taken: set[int] = set()
    for product, sums in in_sums.items():
        if uses[product] == 1 and (free := sums - taken):
            taken.add(free.pop())
    return total.plus(_NONE._replace(joined=len(taken)))


def _cost(kind: str) -> Ops:
    if kind in _COSTS:
        return _COSTS[kind]
    direct = {"+": "adds", "-": "adds", "*": "multiplies", "/": "divisions", "sqrt": "roots"}
    return _NONE._replace(**{direct.get(kind, "library" if kind in _LIBRARY else "logic"): 1})
