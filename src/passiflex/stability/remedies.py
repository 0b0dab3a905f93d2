"""What would make a law hold that does not: every change that is offered was tried, by the judge that refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.problems.altered import rewritten, with_flange
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.stability.clock_remedies import (
    faster,
    faster_task,
    fewer_missed,
    sooner,
    without_jitter,
)
from passiflex.stability.judgement import Judgement, holds
from passiflex.stability.remedy import INSIDE, Remedy, tried
from passiflex.stability.sooner_sensors import SHARES, sooner_sensors
from passiflex.stability.trial import Change, Trial

Array = NDArray[np.float64]

LIGHTEST = 4.0
"""Largest B_e/B that is offered."""
WEAKER = np.geomspace(0.8, 0.01, 12)
STRONGER = np.geomspace(1.25, 100, 12)
DAMPINGS = (2.0, 5.0, 10.0, 20.0, 50.0, 0.0)
"""k_ns [1/s] that are tried."""
TOOL = 0.02
"""Inertia of a tool [kg m^2] that a bare flange may lack."""


def remedies(problem: Problem, found: Judgement) -> Iterator[Remedy]:
    """Yield what makes an unstable problem hold, the change of a number first; all were tried as a whole scenario."""
    trial = Trial(problem, found)
    yield from (Remedy(*sooner) for sooner in sooner_sensors(trial.loop.problem))
    for look in LOST if found.missed else FAST:
        for remedy in look(trial):
            if _is_new(problem, remedy) and tried(problem, remedy):
                yield remedy
    if holds(with_flange(trial.loop.problem, TOOL), native=False):
        yield Remedy(f"a tool with an inertia of {TOOL:g} kg m² on the flange, in the robot's file too", {})


def _inertia(t: Trial) -> Iterator[Remedy]:
    """Yield B_e of the joint that moves most, or of all joints that are lighter than needed."""
    if not t.shapes:
        return
    own = t.gains["shaped_inertia"] / t.own_inertia
    joint = t.found.spectrum.joint - 1
    alone = np.arange(own.size) == joint
    everyone = ("each joint", np.ones(own.size, dtype=bool))
    for who, mask in (
        (everyone,) if t.found.missed or own.size == 1 else ((f"joint {joint + 1}", alone), everyone)
    ):

        def raised(ratio: float, mask: NDArray[np.bool_] = mask) -> Array:
            return np.where(mask, np.maximum(own, ratio), own)

        start = float(own[mask].min())
        border = _least(
            lambda r: t.stable(lambda g: {**g, "shaped_inertia": raised(r) * t.own_inertia}),
            start,
            *((5, 1.4) if t.found.missed else ()),
        )
        if border is not None:
            ratio = [float(f"{v:.3g}") for v in raised(min(rounded_up(INSIDE * border), LIGHTEST))]
            words = f"B_e of {who} at least {border:.2g} B (now {start:.2g} B)"
            yield Remedy(words, _law(t, {"shaped_inertia": {"ratio": ratio}}))
            return


def _unshaped(t: Trial) -> Iterator[Remedy]:
    """Yield K_e = K, with a B_e for it."""
    if not t.shapes or np.allclose(t.gains["shaped_stiffness"], t.own_stiffness):
        return
    own = float((t.gains["shaped_inertia"] / t.own_inertia).min())

    def changed(ratio: float) -> Change:
        return lambda g: {
            **g,
            "shaped_stiffness": t.own_stiffness,
            "shaped_inertia": np.maximum(g["shaped_inertia"], ratio * t.own_inertia),
        }

    border = own if t.stable(changed(own)) else _least(lambda r: t.stable(changed(r)), own)
    if border is None:
        return
    entry: dict[str, Any] = {"shaped_stiffness": {"ratio": 1}}
    words = "K_e = K"
    if border > own:
        entry["shaped_inertia"] = {"ratio": min(rounded_up(INSIDE * border), LIGHTEST)}
        words += f" with B_e at least {border:.2g} B"
    yield Remedy(words, _law(t, entry))


def _damping(t: Trial) -> Iterator[Remedy]:
    yield from _scaled(t, "damping", "D_x")


def _stiffness(t: Trial) -> Iterator[Remedy]:
    yield from _scaled(t, "stiffness", "K_x")


def _scaled(t: Trial, name: str, symbol: str) -> Iterator[Remedy]:
    """Yield a gain times the factor nearest to 1 that holds, lower as well as higher."""
    if t.found.part == "gains":
        return  # which of the changes is to be another, its author knows
    found = []
    for factors in (WEAKER, STRONGER):

        def times(factor: float) -> Change:
            return lambda g: {**g, name: factor * g[name]}

        factor = next((f for f in map(float, factors) if t.stable(times(f))), None)
        if factor is not None:
            found.append(float(f"{factor / INSIDE if factor < 1 else factor * INSIDE:.2g}"))
    for factor in sorted(found, key=lambda f: abs(math.log(f))):
        entry = {name: {"matrix": (factor * t.gains[name]).tolist()}}
        yield Remedy(f"{symbol} times {factor:g}", _law(t, entry))


def _softer(t: Trial) -> Iterator[Remedy]:
    """Yield a softer law, where neither K_x nor D_x alone is enough: at the same damping ratio, or both alike."""
    if t.found.part == "gains" or any(
        True for name in ("damping", "stiffness") for _ in _scaled(t, name, "")
    ):
        return
    own = {"shaped_stiffness": t.own_stiffness, "shaped_inertia": t.own_inertia} if t.shapes else {}
    own = {name: value for name, value in own.items() if not np.allclose(t.gains[name], value)}
    for unshaped in (False, True) if own else (False,):
        for power in (2, 1):

            def scaled(f: float, power: int = power, unshaped: bool = unshaped) -> Change:
                return lambda g: {
                    **g,
                    "stiffness": f**power * g["stiffness"],
                    "damping": f * g["damping"],
                    **(own if unshaped else {}),
                }

            factor = next((f for f in map(float, WEAKER) if t.stable(scaled(f))), None)
            if factor is not None:
                f = float(f"{factor / INSIDE:.2g}")
                softer = scaled(f)(t.gains)
                entry: dict[str, Any] = {n: {"matrix": softer[n].tolist()} for n in ("stiffness", "damping")}
                words = f"K_x times {f**power:.2g} with D_x times {f:g}"
                for name in own if unshaped else ():
                    entry[name] = {"ratio": 1}
                    words += ", K_e = K" if name == "shaped_stiffness" else ", B_e = B"
                yield Remedy(words, _law(t, entry))


def _self_motion(t: Trial) -> Iterator[Remedy]:
    n, k = t.problem.law.robot.n, t.problem.law.task.size
    if n <= k or t.found.part == "fallback":
        return
    now = float(t.gains["null_space_damping"])

    def damped(value: float) -> Change:
        return lambda g: {**g, "null_space_damping": np.array(value)}

    for value in DAMPINGS:
        if value != now and t.stable(damped(value)):
            words = f"null_space_damping of {value:g} 1/s (now {now:g})"
            yield Remedy(words, {"law": {"null_space_damping": value}})
            return


def _less_compensation(t: Trial) -> Iterator[Remedy]:
    """Yield less of the viscous friction that the actions make up for."""
    own = t.loop.parts.unpack("actions", t.loop.problem.numbers)["viscous_compensation"]
    for share in SHARES if own.any() and t.found.part != "fallback" else ():
        remedy = Remedy(
            f"actions.viscous_compensation times {share:g}",
            {"actions": {"viscous_compensation": (share * own).tolist()}},
        )
        if tried(t.problem, remedy):
            yield remedy
            return


def without_compensation(problem: SampledProblem) -> SampledProblem:
    """Return the problem without the actions against viscous friction."""
    none = np.zeros(problem.law.robot.n)
    return problem.with_numbers({"viscous_compensation": none}, "actions")


def _as_the_law(t: Trial) -> Iterator[Remedy]:
    """Yield a fallback that is shaped as the law is, which holds if that law does."""
    if t.found.part != "fallback" or not t.shapes or t.loop.problem.allow_unstable:
        return
    own = t.problem.law.layout.unpack(t.problem.gains)
    shaping = {name: own[name].tolist() for name in ("shaped_stiffness", "shaped_inertia")}
    yield Remedy("a fallback that is shaped as the law is", {"control": {"fallback": shaping}})


def _other_loop(t: Trial) -> Iterator[Remedy]:
    if not t.shapes:
        return
    matched = t.loop.problem.controller.inner.predicts
    inner = "plain" if matched else "matched"
    control = {"inner_loop": inner} | ({} if matched else {"external_torque": "none"})
    told = "" if matched else ", with external_torque: none"
    yield Remedy(f"the {inner} inner loop{told}", {"control": control})


FAST = (
    without_jitter, faster_task, _less_compensation, _inertia, _unshaped, _damping, _stiffness, _softer, _as_the_law,
    _self_motion, faster, sooner, _other_loop,
)  # fmt: skip
LOST = (fewer_missed, _inertia, _other_loop)
"""What is tried, where periods are missed and where they are not: their judgement takes a hundred times as long."""


def _law(t: Trial, entry: Mapping[str, Any]) -> Mapping[str, Any]:
    return {"control": {"fallback": entry}} if t.found.part == "fallback" else {"law": entry}


def _is_new(problem: Problem, remedy: Remedy) -> bool:
    return rewritten(problem.text, remedy.entry) != rewritten(problem.text, {})


def _least(
    stable: Callable[[float], bool], start: float, points: int = 17, precision: float = 1.02
) -> float | None:
    """Return the least ratio above `start` that holds; None if none up to `LIGHTEST` does."""
    tried = np.geomspace(start, max(LIGHTEST, start), points + 1)[1:]
    high = next((float(r) for r in tried if stable(float(r))), None)
    if high is None:
        return None
    low = high * start / float(tried[0])
    while high / low > precision:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if stable(middle) else (middle, high)
    return high


def rounded_up(value: float) -> float:
    """Return the value with two digits, rounded up."""
    step = 10 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(round(value / step, 6)) * step
