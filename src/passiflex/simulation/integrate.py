"""Two ways through time: CVODES for smooth stretches, Runge-Kutta 4 in native code under held noise."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.native import FixedStep, Refinement, fastest_pole, stable_step
from passiflex.native.fixed_step import STABILITY_LIMIT

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
SLOW_POLE = 1e4
"""Up to this pole [1/s] Runge-Kutta resolves a run faster than CVODES, which crawls along undamped modes."""


class Stretch(NamedTuple):
    """States and energies at the asked instants; rows after a failure are NaN, and `failure` says why."""

    states: Array
    energies: Array
    failure: str


def smooth_stretch(
    rhs: cs.Function, x: Array, u: Array, p: Array, instants: Array, tolerance: float
) -> Stretch:
    """Integrate ẋ, powers = rhs(x, u, p) with constant u by CVODES (BDF), to `instants` after the start.

    Parameters
    ----------
    instants: Increasing times > 0 [s].
    tolerance: Relative tolerance; the absolute one is a hundredth of it.
    """
    integrator = _cvodes(rhs, tuple(instants.tolist()), tolerance)
    states = np.full((instants.size, x.size), np.nan)
    energies = np.full((instants.size, rhs.size1_out(1)), np.nan)
    failure = _evaluate(
        integrator,
        {"x0": x, "p": np.concatenate([u, p])},
        {"xf": states.reshape(-1), "qf": energies.reshape(-1)},
    )
    return Stretch(states, energies, failure)


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
) -> Stretch:
    """Integrate under inputs held for `period` each, with the step taken from the fastest pole at the start.

    Parameters
    ----------
    held: Inputs (N, n_u), row i during period i.
    rows: Numbers of periods after which to record, ≥ 1.
    share: Of the stability limit.
    """
    pole = fastest_pole(stepper.rhs, x, held[0], p)
    if refused := _too_fast(pole, period * len(held), share):
        return _lost_from_the_start(rows.size, stepper, refused)
    substeps = stable_step(pole, period, share)
    result = stepper.advance(x, np.zeros(stepper.n_q), held, p, period, substeps, refine=REFINE)
    return Stretch(result.states[rows], result.quads[rows], _lost(result.completed, len(held), period))


def resolved_stretch(
    stepper: FixedStep, x: Array, u: Array, p: Array, instants: Array, pole: float, share: float = RESOLVED
) -> Stretch:
    """Integrate with constant u by Runge-Kutta 4, at a share of the stability limit of the fastest pole [1/s]."""
    if refused := _too_fast(pole, float(instants[-1]), share):
        return _lost_from_the_start(instants.size, stepper, refused)
    states, energies, total = [], [], np.zeros(stepper.n_q)
    elapsed = 0.0
    for period, count in _even(np.diff(instants, prepend=0.0)):
        substeps = stable_step(pole, period, share)
        result = stepper.advance(x, total, np.tile(u, (count, 1)), p, period, substeps)
        states.append(result.states[1:])
        energies.append(result.quads[1:])
        if lost := _lost(result.completed, count, period, elapsed):
            rest = instants.size - sum(map(len, states))
            states.append(np.full((rest, x.size), np.nan))
            energies.append(np.full((rest, stepper.n_q), np.nan))
            return Stretch(np.vstack(states), np.vstack(energies), lost)
        elapsed += count * period
        x, total = result.states[-1], result.quads[-1]
    return Stretch(np.vstack(states), np.vstack(energies), "")


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


def _lost_from_the_start(count: int, stepper: FixedStep, why: str) -> Stretch:
    return Stretch(np.full((count, stepper.n_x), np.nan), np.full((count, stepper.n_q), np.nan), why)


def _lost(completed: int, count: int, period: float, elapsed: float = 0.0) -> str:
    if completed == count:
        return ""
    return f"the state left the finite numbers {elapsed + completed * period:.4g} s after the last event"


def _reason(error: RuntimeError) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else "CVODES failed"
