"""What a law makes of a little off rest: the derivative of one compiled period, sensors and estimators included."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.loops.compiled import CompiledSampledLoop
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.problems.problem import SampledProblem
from passiflex.sampled.motors import UNLIMITED_TORQUE
from passiflex.stability.loop_at_rest import AT_REST, AtRest, Standing, loop_at_rest

Array = NDArray[np.float64]
Gains = Mapping[str, ArrayLike]
Key = tuple[tuple[str, tuple[int, ...], bytes], ...]

IDEAL = {
    "torque_offset": 0.0,
    "link_offset": 0.0,
    "motor_offset": 0.0,
    "link_resolution": 0.0,
    "motor_resolution": 0.0,
    "torque_limit": UNLIMITED_TORQUE,
    "torque_rate_limit": UNLIMITED_TORQUE,
    "coulomb_friction": 0.0,
    "coulomb_compensation": 0.0,
}
"""What has no linear approximation is left out, and constants."""
NOISE = ("torque_noise", "link_noise", "motor_noise")
KEPT = 8
"""Derivatives that are remembered."""


class LawSlope:
    """The derivative of (memory, command) by (x, memory, noise of τ_a; of q, θ if there is any) of one period at rest.

    By central differences on the compiled code, which are exact to 1e-8 here.

    Attributes
    ----------
    x: Where the robot stands (N,).
    remembered: Which numbers of the memory act back.
    numbers: Flat parameters of the period, with what has no linear approximation left out.
    """

    def __init__(self, problem: SampledProblem, at: Standing, compiled: CompiledSampledLoop):
        self.problem, self.at, self.compiled = problem, at, compiled
        self.parts = compiled.loop.parameters
        numbers = np.concatenate([at.plant, problem.numbers[at.plant.size :]])
        self.numbers = self.parts.replaced(numbers, IDEAL)
        self.remembered = _acting(compiled.loop)
        self.n = problem.law.robot.n
        self.x = compiled.loop.plant.at_rest(at.q, at.theta, at.arm.pose)
        self._known: dict[tuple[float, float, Key, bool], Array] = {}
        self._rest: tuple[tuple[float, Key], AtRest] | None = None

    def by(self, period: float, elapsed: float, gains: Gains, *, due: bool = True) -> Array:
        """Return the derivative `elapsed` seconds after the law last ran, with gains in place of the problem's.

        An outer loop with a clock of its own runs if it is `due`; else its last torque is held.
        """
        key = (period, elapsed, hashable(gains), due)
        if key not in self._known:
            if len(self._known) >= KEPT:
                self._known.pop(next(iter(self._known)))
            self._known[key] = self._differences(period, elapsed, gains, due)
        return self._known[key]

    def torque(self, at: Standing) -> Array:
        """Return ∂τ_a/∂x (n, N) of a robot, as these sensors have it before their noise."""
        plant = self.parts["plant"].unpack(at.plant)
        sensors = self.parts.unpack("sensors", self.numbers)
        seen = 1 + sensors["torque_scale"]
        K, D = np.diag(seen * plant["joint_stiffness"]), np.diag(seen * plant["joint_damping"])
        return np.hstack([-K, K, -D, D, np.zeros((self.n, self.x.size - 4 * self.n))])

    def _differences(self, period: float, elapsed: float, gains: Gains, due: bool) -> Array:
        control, row_layout = self.compiled.control, self.compiled.loop.row
        told = row_layout.columns(lambda f: f.name in NOISE)
        own = self.parts["gains"].unpack(self.problem.gains) | {k: np.asarray(v) for k, v in gains.items()}
        memory, row, phi = self._at_rest(own, elapsed)
        if due and self.problem.controller.held_task:
            memory = memory.copy()
            memory[self.compiled.loop.memory.slices["task_age"]] = self.problem.task_periods * period
        numbers = self.parts.replaced(self.numbers, own, "gains")
        numbers = self.parts.replaced(numbers, {"period": period}, "inner")
        numbers = self.parts.replaced(numbers, {"posture": phi}, "actions")  # at rest, that spring is slack
        n_x, n_c = self.x.size, self.remembered.size

        def evaluate(points: Array) -> Array:
            memories = np.tile(memory, (len(points), 1))
            memories[:, self.remembered] = points[:, n_x : n_x + n_c]
            rows = np.tile(row, (len(points), 1))
            rows[:, told] += points[:, n_x + n_c :]
            after, command, _ = control.map(points[:, :n_x], memories, rows, numbers)
            return np.hstack([after[:, self.remembered], command])

        return slope(evaluate, np.concatenate([self.x, memory[self.remembered], np.zeros(told.size)]))

    def _at_rest(self, gains: Gains, elapsed: float) -> AtRest:
        """Return where the law rests, which is asked again and again for gains that change nothing there."""
        deciding = {name: gains[name] for name in AT_REST if name in gains}  # it is told of no other
        key = elapsed, hashable(deciding)
        if self._rest is None or self._rest[0] != key:
            self._rest = key, loop_at_rest(self.problem, self.compiled.loop, deciding, elapsed, self.at)
        return self._rest[1]


def hashable(gains: Gains) -> Key:
    """Return gains as what a dictionary may be asked for."""
    arrays = {name: np.asarray(value, dtype=float) for name, value in sorted(gains.items())}
    return tuple((name, a.shape, a.tobytes()) for name, a in arrays.items())


def slope(f: Callable[[Array], Array], x: Array) -> Array:
    """Return ∂f/∂x (m, n) by central differences; f maps rows to rows."""
    points, h = differences(x)
    values = f(points)
    return ((values[: x.size] - values[x.size :]) / (2 * h[:, None])).T


def differences(x: Array) -> tuple[Array, Array]:
    """Return the points of a central difference about x, (2n, n): all steps up, then all down; and the steps (n,)."""
    h = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(x), 1.0) / 10
    return np.vstack([x + np.diag(h), x - np.diag(h)]), h


@lru_cache(maxsize=16)
def _acting(loop: SampledLoop) -> NDArray[np.intp]:
    """Return which numbers of the memory act on a command, this period's or, by way of others, a later one's."""
    memory, control, n = loop.memory, loop.control, loop.controller.law.robot.n
    named = memory.columns(lambda f: f.acts)  # the tank does not while it is full
    kept, told = (
        np.array(cs.DM(control.jac_sparsity(out, 1), 1.0).full(), dtype=bool)[:, named] for out in (0, 1)
    )
    writes, acts = kept[named], told.any(axis=0)
    assert len(told) == n
    while (more := acts | writes[acts].any(axis=0)).sum() > acts.sum():
        acts = more
    return named[acts]
