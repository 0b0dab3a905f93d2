"""What errors of the sensors cost the books of a tank, said before the run: see `sampled.measurement_bound`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from passiflex.problems.altered import altered
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.sampled.measurement_bound import SIGMAS
from passiflex.stability.driven_loop import driven, whole_cycle
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.noise_credit import POSTURES, REACH, noise_credit
from passiflex.stability.storage_jitter import storage_jitter

Array = NDArray[np.float64]

HEAVIER = (0.3, 1.0)
"""B_e/B that are tried against the credit of noise."""
TREMBLING = 0.5
"""Share of the floor up to which a storage may shake with the noise that is read: there the law falls back."""
FILTERS = (100.0, 50.0, 20.0)
"""Of velocities [Hz], that are tried against it."""
HELD = 20.0
"""Stiffness [N m/rad] that is tried against a self-motion that an offset moves."""


def book_cautions(problem: Problem) -> tuple[str, ...]:
    """Return what noise, offset and missed periods leave of the tank's books, a line each, with remedies that help."""
    if not isinstance(problem, SampledProblem):
        return ()
    tank = problem.controller.tank
    if tank is None or not tank.measures:
        return ()
    return (*_noise(problem), *_jitter(problem), *_late(problem), *_offset(problem), *_missed(problem))


def _noise(problem: SampledProblem) -> tuple[str, ...]:
    power, tank = POSTURES * noise_credit(problem), problem.tank
    if power * problem.duration <= tank.floor or problem.noise is None:
        return ()
    lasts = f"torque noise that lasts {problem.noise.hold * 1e3:g} ms" * bool(problem.noise.variance)
    reads = "noise on q, which the law answers at once," * bool(problem.noise.link_deviation)
    return (
        f"{lasts or reads} credits the tank with energy that nobody gave: "
        f"{power:.2g} W are charged for it, {power * problem.duration:.2g} J in {problem.duration:g} s, where "
        f"{tank.initial - tank.floor:.3g} J are above its floor; {_lighter(problem, power)}",
    )


def _jitter(problem: SampledProblem) -> tuple[str, ...]:
    if problem.noise is None or not problem.noise.moves:
        return ()
    shakes, floor = _shaken(problem), problem.tank.floor
    if shakes <= TREMBLING * floor:
        return ()
    return (
        f"noise on the positions shakes the storage that the tank reads, by up to {shakes:.2g} J where {floor:g} J are "
        f"stored: an active loop is seen that much later, and the floor holds {floor:g} J back; "
        f"{_calmer(problem)}",
    )


def _late(problem: SampledProblem) -> tuple[str, ...]:
    late, floor = max(problem.lateness.link, problem.lateness.torque), problem.tank.floor
    if not late:
        return ()
    return (
        f"the tank sees what goes through the joints {late * 1e3:.3g} ms late, and until then can but guess it: its "
        f"floor of {floor:g} J covers that up to {floor / late:.3g} W"
        + "; with periods missed as well it may fall back for good though the loop is sound"
        * bool(problem.missed or problem.lost),
    )


def _shaken(problem: SampledProblem) -> float:
    """Return how much S may shake where it is as much as the floor holds back [J]."""
    at_rest = storage_jitter(problem)
    return POSTURES * at_rest.mean + 2 * SIGMAS * math.sqrt(2 * POSTURES * at_rest.share * problem.tank.floor)


def _calmer(problem: SampledProblem) -> str:
    """Return a low-pass of the velocities with which the floor is enough, found by trying; or what else there is."""
    now = problem.parts.unpack("sensors", problem.numbers)
    for frequency in FILTERS if now["velocity_differences"] and not problem.controller.inner.predicts else ():
        pole = 2 * math.pi * frequency
        changed = problem.with_numbers({"velocity_bandwidth": pole}, "sensors")
        if pole < now["velocity_bandwidth"] and LinearLoop(changed).radius() < 1:
            left = _shaken(changed)
            if left <= TREMBLING * problem.tank.floor:
                return f"try sensors.velocity_filter: {frequency:g} Hz, with {left:.2g} J"
    return "try less noise, or a higher floor (tank.floor)"


def _lighter(problem: SampledProblem, power: float) -> str:
    """Return a shaped inertia that at least halves the credit, found by trying; or what else there is."""
    law, model = problem.law, problem.law.robot.layout.unpack(problem.model)
    if law.shapes:
        own = law.layout.unpack(problem.gains)["shaped_inertia"] / model["motor_inertia"]
        for ratio in (r for r in HEAVIER if (r > own).all()):
            changed = altered(problem, gains={"shaped_inertia": ratio * model["motor_inertia"]})
            left = POSTURES * noise_credit(changed)
            if left <= power / 2 and LinearLoop(changed).radius() < 1:
                return f"try shaped_inertia: {{ratio: {ratio:g}}}, with {left:.2g} W"
    return "try less noise at low frequencies, or a fuller tank (tank.initial)"


def _offset(problem: SampledProblem) -> tuple[str, ...]:
    offset = problem.parts.unpack("errors", problem.numbers)["torque_offset"]
    given, floor = float(offset.sum()) * REACH, problem.tank.floor
    if given <= floor:
        return ()
    text = (
        f"an offset of the torque sensors of up to {offset.max():.2g} N m gives up to {given:.2g} J while the joints "
        f"move by {REACH:g} rad, and the tank, whose floor holds {floor:g} J back, sees it too late; "
        "try to zero the sensors before the start, or a floor above that (tank.floor)"
    )
    if problem.law.robot.n > problem.law.task.size and _moved_by(problem, offset).max() >= REACH:
        held = {"posture_stiffness": np.full(problem.law.robot.n, HELD)}
        changed = problem.with_numbers(held, "actions")
        text += "; it also moves a self-motion that nothing holds"
        if _moved_by(changed, offset).max() < REACH:
            text += f" (actions.posture_stiffness: {HELD:g} N m/rad holds it while the valve is open)"
    return (text,)


def _moved_by(problem: SampledProblem, offset: Array) -> Array:
    """Return |q − q₀| (n,) at the end of the run for the worst signs of an offset (n,), by the linear loop."""
    loop = LinearLoop(problem)
    whole = whole_cycle(driven(loop))
    answer, power = whole.G.reshape(len(whole.G), -1, loop.n).sum(axis=1), whole.A
    for _ in range(max(1, int(np.log2(problem.duration / loop.cycle())))):
        answer, power = answer + power @ answer, power @ power
        if np.abs(answer[: loop.n]).max() * offset.max() > REACH:
            break
    moved: Array = np.abs(answer[: loop.n]) @ offset
    return moved


def _missed(problem: SampledProblem) -> tuple[str, ...]:
    noise = problem.noise
    if not problem.missed or noise is None or not noise.variance:
        return ()
    return (
        f"{problem.missed:.0%} of the periods are missed while the torque sensors are noisy: what goes through the "
        "joints between two readings is only bounded (measurement_bound of the run), and nothing is granted on it",
    )
