"""Two ways through time: CVODES for smooth stretches, Runge-Kutta 4 in native code under held noise."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.native import FixedStep, Refinement, Watched, fastest_pole, stable_step
from passiflex.native.stability import STABILITY_LIMIT

Array = NDArray[np.float64]

SAFETY = 0.7
"""Share of Runge-Kutta's stability limit that a step uses at most, and under noise."""
REFINE = Refinement(steps=5, split=5)
"""Finer steps after each jump of the noise: 300 times less error in the energies of 2 s of Fig. 3 (1.2 J to 3.5 mJ)."""
RESOLVED = 0.2
"""Share of the stability limit at which Runge-Kutta resolves the fastest mode instead of merely surviving it."""
USUAL_TOLERANCE = 1e-9
"""Tolerance for which these shares are meant; the error of a step of order 4 goes with its fourth power."""
MOST_STEPS = 20_000_000
"""Steps of one stretch at most, about two minutes; more of them is no simulation but a mistake."""
CHECK, FIRST_CHECK, MOST_CHECKS = 0.5e-3, 1e-6, 100_000
"""A smooth stretch is looked at so often [s], after an event from a microsecond on, each time twice as late; a stretch
of more than so many such intervals, so many times."""
CLOSER = 64
"""Looks at what is between the two that are next to an extremum: what h²/8 of its second derivative hides is then 1e-3
as much."""
SLOW_POLE = 1e4
"""Up to this pole [1/s] Runge-Kutta resolves a run faster than CVODES, which crawls along undamped modes."""


class Stretch(NamedTuple):
    """States and energies at the asked instants; rows after a failure are NaN, and `failure` says why.

    Energies count from where the stretch was told to begin, or from 0; `watched` is what the watch remembers.
    """

    states: Array
    energies: Array
    failure: str
    watched: Array


class Begun(NamedTuple):
    """What there is before a stretch: the energies so far, and what the stepper's watch remembers."""

    energies: Array
    watched: Watched


def smooth_stretch(
    rhs: cs.Function,
    x: Array,
    u: Array,
    p: Array,
    instants: Array,
    tolerance: float,
    stepper: FixedStep | None = None,
    begun: Begun | None = None,
) -> Stretch:
    """Integrate ẋ, powers = rhs(x, u, p) with constant u by CVODES (BDF), to `instants` after the start.

    Parameters
    ----------
    instants: Increasing times > 0 [s].
    tolerance: Relative tolerance; the absolute one is a hundredth of it.
    stepper: Has the watch, which sees the start, the instants and `CHECK`ed times between.
    """
    times, asked = _checked(instants) if stepper is not None else (instants, np.arange(instants.size))
    integrator = _cvodes(rhs, tuple(times.tolist()), tolerance)
    states = np.full((times.size, x.size), np.nan)
    energies = np.full((times.size, rhs.size1_out(1)), np.nan)
    failure = _evaluate(
        integrator,
        {"x0": x, "p": np.concatenate([u, p])},
        {"xf": states.reshape(-1), "qf": energies.reshape(-1)},
    )
    if stepper is None or begun is None:
        return Stretch(states, energies, failure, np.zeros(0))
    energies += begun.energies
    seen = np.vstack([np.concatenate([x, begun.energies]), np.hstack([states, energies])])
    time = begun.watched.time + np.concatenate([[0.0], times])
    watched = stepper.watch_rows(begun.watched, time, seen, u) if not failure else begun.watched.memory
    return Stretch(states[asked], energies[asked], failure, watched)


def around(time: float, apart: float, end: float) -> Array:
    """Return instants around one of a stretch [s] that was looked at so far apart; its extremum is between them."""
    return np.linspace(max(time - apart, FIRST_CHECK), min(time + apart, end), CLOSER)


def _checked(instants: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the times at which a smooth stretch is looked at, and which of them are the instants."""
    end = float(instants[-1])
    early = FIRST_CHECK * 2.0 ** np.arange(np.ceil(np.log2(CHECK / FIRST_CHECK)))
    times = np.concatenate([early, np.arange(CHECK, end, max(CHECK, end / MOST_CHECKS))])
    after = np.minimum(np.searchsorted(instants, times), instants.size - 1)
    before = np.maximum(after - 1, 0)
    gap = np.minimum(np.abs(instants[after] - times), np.abs(instants[before] - times))
    times = np.union1d(times[(times < end) & (gap > FIRST_CHECK / 10)], instants)
    return times, np.searchsorted(times, instants)


@lru_cache(maxsize=64)
def _cvodes(rhs: cs.Function, instants: tuple[float, ...], tolerance: float) -> cs.Function:
    """Return CVODES on rhs from 0 to `instants`; kept, as the runs of a sweep share their instants."""
    n_x, n_u, n_p = (rhs.size1_in(i) for i in range(3))
    state, constants = cs.MX.sym("x", n_x), cs.MX.sym("c", n_u + n_p)
    derivative, powers = rhs(state, constants[:n_u], constants[n_u:])
    problem = {"x": state, "p": constants, "ode": derivative, "quad": powers}
    options = {
        "reltol": tolerance,
        "abstol": tolerance * 1e-2,
        "max_num_steps": 10_000,  # from one instant to the next
        "quad_err_con": True,
        "show_eval_warnings": False,
        "disable_internal_warnings": True,
    }
    return cs.integrator("stretch", "cvodes", problem, 0.0, list(instants), options)


def _evaluate(function: cs.Function, inputs: dict[str, Array], outputs: dict[str, Array]) -> str:
    """Evaluate from and into arrays, without CasADi's matrices between; return why it failed, if it did."""
    buffer, evaluate = function.buffer()
    for name, array in inputs.items():
        buffer.set_arg(function.index_in(name), np.ascontiguousarray(array).data)
    for name, array in outputs.items():
        buffer.set_res(function.index_out(name), array.data)
    try:
        evaluate()
    except RuntimeError as error:
        return _reason(error)
    return "CVODES failed" if buffer.ret() else ""


def held_stretch(
    stepper: FixedStep,
    x: Array,
    held: Array,
    p: Array,
    period: float,
    rows: Array,
    share: float = SAFETY,
    begun: Begun | None = None,
) -> Stretch:
    """Integrate under inputs held for `period` each, with the step taken from the fastest pole at the start.

    Parameters
    ----------
    held: Inputs (N, n_u), row i during period i.
    rows: Numbers of periods after which to record, ≥ 1.
    share: Of the stability limit.
    """
    energies, watched = begun or (np.zeros(stepper.n_q), None)
    pole = fastest_pole(stepper.rhs, x, held[0], p)
    if refused := _too_fast(pole, period * len(held), share):
        return _lost_from_the_start(rows.size, stepper, refused, begun)
    substeps = stable_step(pole, period, share)
    done = stepper.advance(x, energies, held, p, period, substeps, refine=REFINE, watched=watched)
    lost = _lost(done.completed, len(held), period)
    return Stretch(done.states[rows], done.quads[rows], lost, done.watched)


def resolved_stretch(
    stepper: FixedStep,
    x: Array,
    u: Array,
    p: Array,
    instants: Array,
    pole: float,
    share: float = RESOLVED,
    begun: Begun | None = None,
) -> Stretch:
    """Integrate with constant u by Runge-Kutta 4, at a share of the stability limit of the fastest pole [1/s]."""
    total, watched = begun or (np.zeros(stepper.n_q), None)
    if refused := _too_fast(pole, float(instants[-1]), share):
        return _lost_from_the_start(instants.size, stepper, refused, begun)
    states, energies = [], []
    elapsed = 0.0
    for period, count in _even(np.diff(instants, prepend=0.0)):
        substeps, held = stable_step(pole, period, share), np.tile(u, (count, 1))
        done = stepper.advance(x, total, held, p, period, substeps, watched=watched)
        states.append(done.states[1:])
        energies.append(done.quads[1:])
        if lost := _lost(done.completed, count, period, elapsed):
            rest = instants.size - sum(map(len, states))
            states.append(np.full((rest, x.size), np.nan))
            energies.append(np.full((rest, stepper.n_q), np.nan))
            return Stretch(np.vstack(states), np.vstack(energies), lost, done.watched)
        elapsed += count * period
        x, total = done.states[-1], done.quads[-1]
        if watched is not None:
            watched = Watched(done.watched, watched.p, watched.time + count * period)
    return Stretch(np.vstack(states), np.vstack(energies), "", done.watched)


def share_for(share: float, tolerance: float) -> float:
    """Return the share of the stability limit for another tolerance, at most `SAFETY`."""
    return min(SAFETY, share * (tolerance / USUAL_TOLERANCE) ** 0.25)


def _even(intervals: Array) -> list[tuple[float, int]]:
    """Return runs of equal intervals as (length, count)."""
    runs: list[tuple[float, int]] = []
    for length in intervals:
        if runs and abs(runs[-1][0] - length) < 1e-9:
            runs[-1] = (runs[-1][0], runs[-1][1] + 1)
        else:
            runs.append((float(length), 1))
    return runs


def _too_fast(pole: float, duration: float, share: float) -> str:
    """Return why a stretch is not begun; empty if its steps can be counted."""
    steps = pole * duration / (share * STABILITY_LIMIT)
    if steps <= MOST_STEPS:
        return ""
    return f"the fastest pole, {pole:.3g} 1/s, needs {steps:.2g} steps; {MOST_STEPS} are taken at most"


def _lost_from_the_start(count: int, stepper: FixedStep, why: str, begun: Begun | None) -> Stretch:
    states, energies = (np.full((count, size), np.nan) for size in (stepper.n_x, stepper.n_q))
    return Stretch(states, energies, why, np.zeros(0) if begun is None else begun.watched.memory)


def _lost(completed: int, count: int, period: float, elapsed: float = 0.0) -> str:
    if completed == count:
        return ""
    return f"the state left the finite numbers {elapsed + completed * period:.4g} s after the last event"


def _reason(error: RuntimeError) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else "CVODES failed"
