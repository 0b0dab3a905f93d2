"""Why a law does not hold, in words: what it is about the loop that, taken away, makes it hold."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from passiflex.problems.altered import with_flange
from passiflex.problems.problem import Problem
from passiflex.stability.clock_words import counted, delay_words, hertz
from passiflex.stability.judgement import Judgement
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.modes import self_motions
from passiflex.stability.remedies import TOOL, remedies, without_compensation
from passiflex.stability.remedy import Remedy
from passiflex.stability.sooner_sensors import deciding
from passiflex.stability.trial import Change, Trial

SLOW = 0.5
"""Frequency [Hz] below which a motion that grows is called running away, and no trembling."""
HIDDEN = 0.1
"""Largest motion of the task in a mode that is a self-motion, as a share of what the joints could make of it."""
MUCH = "too much damping: D_x on so light an arm is faster than the clock"
SHOWN = 3
"""Remedies of the short answer."""
WHOSE = {"law": "", "gains": "with the gains that it goes over to, ", "fallback": "once fallen back, "}


class Advice(NamedTuple):
    """Why a law does not hold, one number, and what would make it hold; each remedy was tried.

    `str` gives three short lines; the rest of the remedies is in `remedies`.
    """

    cause: str
    number: str
    remedies: tuple[Remedy, ...]

    @property
    def remedy(self) -> str:
        """Return the first remedies in words."""
        offered = [r.words for r in self.remedies[:SHOWN]]
        return "; or ".join(offered) if offered else "nothing that was tried helps: another robot or task"

    def __str__(self) -> str:
        return f"cause: {self.cause}\nnumber: {self.number}\nremedy: {self.remedy}"


def advise(problem: Problem, found: Judgement) -> Advice:
    """Return the advice for a problem that does not hold."""
    trial = Trial(problem, found)
    mode, T = found.spectrum, 1 / found.rate
    own = min(found.delay, trial.loop.problem.delay)
    late = delay_words(own / T)
    if found.delay > own:
        late += f" and {counted((found.delay - own) / T, 'jitter')}"
    number = f"{mode.radius:.4g} per period of {1e3 * T:g} ms, at {hertz(found.rate)} with {late}"
    if found.missed:
        number = (
            f"{100 * found.missed:.2g} % of the periods missed at random, at {hertz(found.rate)} with {late}"
        )
    return Advice(
        f"{WHOSE[found.part]}{_motion(found)}: {next(_reasons(trial), 'the gains together')}",
        number,
        tuple(remedies(problem, found)),
    )


def _motion(found: Judgement) -> str:
    """Return what the arm does."""
    mode = found.spectrum
    if found.missed:
        return f"joint {mode.joint} is left alone for too long"
    if mode.decay >= 0:
        return f"joint {mode.joint} never comes to rest"
    doubles = math.log(2) / -mode.decay
    trembling = mode.frequency > SLOW and doubles * mode.frequency > 0.1
    moves = f"trembles at {mode.frequency:.0f} Hz" if trembling else "runs away"
    return f"joint {mode.joint} {moves}, twice as far every {_time(doubles)}"


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.2g} ms" if seconds < 1 else f"{seconds:.2g} s"


def _reasons(t: Trial) -> Iterator[str]:
    """Yield what, taken away, makes the loop hold: the rarest first."""
    s, gains, joint = t.loop.problem, t.gains, t.found.spectrum.joint
    late = t.found.delay
    if t.found.missed:
        yield "periods that are missed let a torque act for longer than this loop bears"
    if s.jitter and late > s.delay and t.stable(late=s.delay):
        yield "commands that the jitter makes later than the law knows"
    for entry, late in deciding(s):
        yield f"sensors that are late, by a {entry} of {1e3 * late:.3g} ms"
    if _is_self_motion(t):
        stiff = t.loop.parts.unpack("actions", t.loop.problem.numbers)["posture_stiffness"]
        yield (
            "a self-motion, by the spring to a posture"
            if stiff.any()
            else ("a self-motion that the task does not see")
        )
    if _compensation(t).any() and LinearLoop(without_compensation(s), native=False).radius(delay=late) < 1:
        yield "viscous friction is made up for that the motors do not have"
    if _bare_flange(t):
        yield f"a light last body swings against motor {joint}; with {TOOL:g} kg m² more on the flange it holds"
    if t.shapes and not np.allclose(gains["shaped_stiffness"], t.own_stiffness):
        ratio = float((gains["shaped_stiffness"] / t.own_stiffness)[joint - 1])
        if t.stable(lambda g: {**g, "shaped_stiffness": t.own_stiffness}):
            yield f"K_e = {ratio:.3g} K needs the links' inertia in the loop, which is too fast for this clock"
    if t.stable(lambda g: {**g, "damping": g["damping"] / 3}):
        yield MUCH
    if t.shapes:
        ratio = float((gains["shaped_inertia"] / t.own_inertia)[joint - 1])
        if t.stable(lambda g: {**g, "shaped_inertia": np.maximum(g["shaped_inertia"], t.own_inertia)}):
            clock = "this clock" if not late else "this clock and delay"
            yield f"B_e = {ratio:.2g} B makes motor {joint} too light for {clock}"
    if t.stable(lambda g: {**g, "damping": g["damping"] / 30}):
        yield MUCH
    if late and t.stable(late=0.0):
        yield "the delay"
    if t.shapes and not np.allclose(gains["shaped_stiffness"], t.own_stiffness):
        own = {"shaped_stiffness": t.own_stiffness, "shaped_inertia": t.own_inertia}
        if t.stable(lambda g: g | own):
            yield "K_e and B_e together ask for joints that are faster than the clock"
    if t.stable(lambda g: {**g, "damping": 3 * g["damping"]}):
        yield "too little damping: D_x is small for this K_x"
    if any(t.stable(_softened(share)) for share in (3, 30, 300)):
        yield "K_x is too stiff for this clock"
    if t.stable(stretched=0.1):
        yield "the clock is too slow for these gains"


def _softened(share: float) -> Change:
    return lambda g: {**g, "stiffness": g["stiffness"] / share}


def _is_self_motion(t: Trial) -> bool:
    """Return whether the end effector hardly moves in the mode that grows."""
    case = t.cases[0]
    J = t.loop.task_jacobian
    modes = case.loop.modes(case.loop.matrix(None, t.found.delay, case.gains))
    if not self_motions(J):
        return False
    worst = int(np.argmax(np.where(modes.drifting, 0, np.abs(modes.values))))
    q = modes.vectors[: t.loop.n, worst]
    return bool(np.linalg.norm(J @ q) < HIDDEN * np.linalg.norm(J, 2) * np.linalg.norm(q))


def _bare_flange(t: Trial) -> bool:
    """Return whether a heavier last body makes the loop hold."""
    heavier = LinearLoop(with_flange(t.loop.problem, TOOL), native=False)
    return t.found.part == "law" and heavier.radius(delay=t.found.delay) < 1


def _compensation(t: Trial) -> np.ndarray:
    return t.loop.parts.unpack("actions", t.loop.problem.numbers)["viscous_compensation"]
