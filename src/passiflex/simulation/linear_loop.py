"""The sampled loop near rest, as one matrix per period: which gains are stable at a rate and delay, and how fast."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import ValueRangeError
from passiflex.sampled.motors import UNLIMITED_TORQUE
from passiflex.simulation.altered import replaced
from passiflex.simulation.compiled import compiled_sampled_loop
from passiflex.simulation.loop_at_rest import loop_at_rest
from passiflex.simulation.plant import SURROUNDINGS
from passiflex.simulation.problem import Problem

Array = NDArray[np.float64]

DRIFT = 1e-5
"""An eigenvalue this close to 1 belongs to a self-motion that nothing holds or nothing damps."""
IDEAL = {
    "torque_offset": 0.0,
    "link_offset": 0.0,
    "motor_offset": 0.0,
    "link_resolution": 0.0,
    "motor_resolution": 0.0,
    "torque_limit": UNLIMITED_TORQUE,
    "torque_rate_limit": UNLIMITED_TORQUE,
    "coulomb_friction": 0.0,
}
"""What has no linear approximation is left out, and constants."""
REMEMBERED = (
    "read_q", "read_theta", "read_dq", "read_dtheta", "read_tau_a", "read_wrench",
    "observed_torque", "momentum", "known_torque",
    "seen_theta", "seen_deflection", "seen_dq", "seen_ddq", "in_flight", "given_torque",
)  # fmt: skip
"""The memory that acts back on the command; the tank does not while it is full."""


class Spectrum(NamedTuple):
    """The slowest to decay, or fastest to grow, of the loop's modes.

    Attributes
    ----------
    radius: Largest |eigenvalue| over one period, the self-motion's drift left out; stable below 1.
    frequency: Of that mode [Hz].
    joint: Number of the joint that moves most in it, from 1.
    decay: Its decay rate [1/s], negative if it grows.
    drifting: Number of eigenvalues at 1: self-motions that no spring holds, or (twice) that nothing damps.
    """

    radius: float
    frequency: float
    joint: int
    decay: float
    drifting: int

    @property
    def stable(self) -> bool:
        """Return whether every mode decays."""
        return self.radius < 1


class DrivenLoop(NamedTuple):
    """z⁺ = A z + G w, τ = C z + D w: the loop with the noise w of the torque sensors, and its command τ.

    Attributes
    ----------
    A: (N, N), what `LinearLoop.matrix` returns.
    G, C, D: (N, n), (n, N), (n, n).
    """

    A: Array
    G: Array
    C: Array
    D: Array


class LinearLoop:
    """The linear approximation of a sampled problem at its start, for any rate, delay and gains.

    The plant is discretised exactly under held commands (matrix exponential). The derivative of the
    period function, sensors and estimators included, is taken by central differences on the compiled
    code, which are exact to 1e-8 here. Left out is what has no linear approximation: resolution, limits,
    Coulomb friction, and a tank that runs empty.

    A delay that is given here is the robot's: the law goes on to predict over the one that it was built
    for. Where the law is to know of it, make the loop of `altered(problem, delay=…)`.
    """

    def __init__(self, problem: Problem):
        if problem.sampling is None:
            raise ValueRangeError(
                "the scenario has no control rate", got=problem.name, needs="`control: {rate: …}`"
            )
        self.problem, self.s = problem, problem.sampling
        self.compiled = compiled_sampled_loop(problem.sampling.controller)
        loop = self.compiled.loop
        self.n = problem.law.robot.n
        self.parts = loop.parameters
        self.numbers = replaced(self.parts, problem.sampling.numbers, IDEAL)
        self.remembered = np.hstack(
            [
                np.arange(loop.memory.size)[loop.memory.slices[f.name]]
                for f in loop.memory
                if f.name in REMEMBERED
            ]
        )
        zero = np.zeros(self.n)
        self.x = np.concatenate([problem.q, problem.theta, zero, zero])
        self.A, self.B = self._plant()
        self._flows: dict[float, tuple[Array, Array]] = {}

    def spectrum(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: Mapping[str, ArrayLike] | None = None,
    ) -> Spectrum:
        """Return the dominant mode; period and delay [s] and gains are the problem's own unless given."""
        values, vectors = np.linalg.eig(self.matrix(period, delay, gains))
        kept = self._kept(values)
        worst = kept[np.argmax(np.abs(values[kept]))]
        T = self.s.period if period is None else period
        modulus, joints = abs(values[worst]), np.abs(vectors[: 2 * self.n, worst])
        return Spectrum(
            radius=float(modulus),
            frequency=abs(float(np.angle(values[worst]))) / (2 * math.pi * T),
            joint=int(np.argmax(joints[: self.n] + joints[self.n :])) + 1,
            decay=-math.log(max(modulus, 1e-300)) / T,
            drifting=values.size - kept.size,
        )

    def without_actions(self) -> LinearLoop:
        """Return the loop with the tank's valve shut."""
        still = {"posture_stiffness": np.zeros(self.n)}
        numbers = replaced(self.parts, self.s.numbers, still, "actions")
        sampling = dataclasses.replace(self.s, numbers=numbers)
        return LinearLoop(dataclasses.replace(self.problem, sampling=sampling))

    def fallback(self) -> dict[str, Array]:
        """Return the gains of the law that takes over when the tank is overdrawn."""
        before = self.parts[: self.parts._fields.index("fallback")]
        start = sum(part.size for part in before)
        return self.parts.fallback.unpack(self.s.numbers[start : start + self.parts.fallback.size])

    def radius(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: Mapping[str, ArrayLike] | None = None,
    ) -> float:
        """Return the spectral radius alone, in half the time."""
        values = np.linalg.eigvals(self.matrix(period, delay, gains))
        return float(np.abs(values[self._kept(values)]).max())

    def matrix(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: Mapping[str, ArrayLike] | None = None,
    ) -> Array:
        """Return the map of (x, what is remembered, commands on their way) over one period."""
        return self._period(period, delay, gains, noise=False).A

    def driven(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: Mapping[str, ArrayLike] | None = None,
    ) -> DrivenLoop:
        """Return the same with the noise of the torque sensors, and the command that it makes."""
        return self._period(period, delay, gains, noise=True)

    def _period(
        self,
        period: float | None,
        delay: float | None,
        gains: Mapping[str, ArrayLike] | None,
        *,
        noise: bool,
    ) -> DrivenLoop:
        T = self.s.period if period is None else period
        late = self.s.delay if delay is None else delay
        whole = int(late / T + 1e-9)
        part = max(late / T - whole, 0.0)
        slope = self._control(T, dict(gains or {}), noise)  # (memory, command) by (x, memory, noise)
        n_x, n_c, n = self.x.size, self.remembered.size, self.n
        lined = whole + (part > 1e-9)
        size = n_x + n_c + lined * n
        told, heard = slice(0, n_x + n_c), slice(size, size + slope.shape[1] - n_x - n_c)
        command = np.zeros((n, heard.stop))
        command[:, told], command[:, heard] = slope[n_c:, told], slope[n_c:, n_x + n_c :]
        # The command of this period, then those of the periods before it.
        sent = [command] + [np.eye(n, heard.stop, n_x + n_c + i * n) for i in range(lined)]
        out = np.zeros((size, heard.stop))
        if part > 1e-9:
            early, gain_early = self._held(part * T)
            rest, gain_rest = self._held((1 - part) * T)
            out[:n_x, :n_x] = rest @ early
            out[:n_x] += rest @ gain_early @ sent[whole + 1] + gain_rest @ sent[whole]
        else:
            step, gain = self._held(T)
            out[:n_x, :n_x] = step
            out[:n_x] += gain @ sent[whole]
        remembers = slice(n_x, n_x + n_c)
        out[remembers, told], out[remembers, heard] = slope[:n_c, told], slope[:n_c, n_x + n_c :]
        for i in range(lined):
            out[n_x + n_c + i * n : n_x + n_c + (i + 1) * n] = sent[i]
        return DrivenLoop(out[:, :size], out[:, size:], command[:, :size], command[:, size:])

    def _kept(self, values: NDArray[Any]) -> NDArray[np.intp]:
        """Return which eigenvalues are not those of a self-motion's drift."""
        free = 2 * (self.n - min(self.n, self.problem.law.task.size))
        near = np.argsort(np.abs(values - 1))[:free]
        return np.setdiff1d(np.arange(values.size), near[np.abs(values[near] - 1) < DRIFT])

    def _held(self, time: float) -> tuple[Array, Array]:
        """Return Φ and Γ of the plant over `time` under a held command."""
        if time not in self._flows:
            n_x = self.x.size
            block = np.zeros((n_x + self.n, n_x + self.n))
            block[:n_x, :n_x], block[:n_x, n_x:] = self.A, self.B
            whole = scipy.linalg.expm(block * time)
            self._flows[time] = whole[:n_x, :n_x], whole[:n_x, n_x:]
        return self._flows[time]

    def _plant(self) -> tuple[Array, Array]:
        """Return A and B of the plant at rest."""
        numbers = self.parts.plant.pack(
            self.parts.plant.unpack(self.s.plant) | {"coulomb_friction": np.zeros(self.n)}
        )
        u = np.concatenate([self.s.held, np.zeros(SURROUNDINGS.size)])
        plant = self.compiled.plant
        A = _slope(lambda x: plant.map(x, u, numbers)[0], self.x)
        B = _slope(lambda v: plant.map(self.x, v, numbers)[0], u)[:, : self.n]
        return A, B

    def _control(self, period: float, gains: Mapping[str, ArrayLike], noise: bool) -> Array:
        """Return the derivative of (memory, command) by (x, memory, and noise if wanted) of one period at rest."""
        control, told = self.compiled.control, self.compiled.loop.row.slices["torque_noise"]
        own = self.parts.gains.unpack(self.problem.gains) | {k: np.asarray(v) for k, v in gains.items()}
        memory, row, phi = loop_at_rest(self.problem, self.compiled.loop, own, period)
        numbers = replaced(self.parts, self.numbers, own, "gains")
        numbers = replaced(self.parts, numbers, {"period": period}, "inner")
        numbers = replaced(self.parts, numbers, {"posture": phi}, "actions")  # at rest, that spring is slack
        n_x, n_c = self.x.size, self.remembered.size

        def evaluate(points: Array) -> Array:
            memories = np.tile(memory, (len(points), 1))
            memories[:, self.remembered] = points[:, n_x : n_x + n_c]
            rows = np.tile(row, (len(points), 1))
            rows[:, told] += points[:, n_x + n_c :] if noise else 0.0
            after, command, _ = control.map(points[:, :n_x], memories, rows, numbers)
            return np.hstack([after[:, self.remembered], command])

        unheard = np.zeros(self.n if noise else 0)
        return _slope(evaluate, np.concatenate([self.x, memory[self.remembered], unheard]))


def _slope(f: Callable[[Array], Array], x: Array) -> Array:
    """Return ∂f/∂x (m, n) by central differences; f maps rows to rows."""
    h = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(x), 1.0) / 10
    values = f(np.vstack([x + np.diag(h), x - np.diag(h)]))
    return ((values[: x.size] - values[x.size :]) / (2 * h[:, None])).T
