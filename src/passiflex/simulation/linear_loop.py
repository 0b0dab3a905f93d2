"""The sampled loop near rest, as one matrix per period: which gains are stable at a rate and delay, and how fast."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.control.rigid import RigidImpedanceLaw
from passiflex.errors import ValueRangeError
from passiflex.layout import Layout
from passiflex.sampled.motors import UNLIMITED_TORQUE
from passiflex.simulation.compiled import compiled_sampled_loop
from passiflex.simulation.plant import SURROUNDINGS
from passiflex.simulation.posture import posture
from passiflex.simulation.problem import Problem

Array = NDArray[np.float64]

DRIFT = 1e-5
"""An eigenvalue this close to 1 belongs to a self-motion that nothing holds or nothing damps."""
BRIMFUL = 1e6
"""Level [J] of a tank that holds nothing back."""
IDEAL = {
    "link_resolution": 0.0,
    "motor_resolution": 0.0,
    "torque_limit": UNLIMITED_TORQUE,
    "torque_rate_limit": UNLIMITED_TORQUE,
    "coulomb_friction": 0.0,
}
"""What has no linear approximation is left out."""
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


class LinearLoop:
    """The linear approximation of a sampled problem at its start, for any rate, delay and shaping.

    The plant is discretised exactly under held commands (matrix exponential). The derivative of the
    period function, sensors and estimators included, is taken by central differences on the compiled
    code, which are exact to 1e-8 here. Left out is what has no linear approximation: resolution, limits,
    Coulomb friction, and a tank that runs empty.
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
        self.numbers = self._replaced(problem.sampling.numbers, IDEAL)
        self.model = self.parts.model.unpack(problem.model)
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

    def spectrum(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: dict[str, Array] | None = None,
    ) -> Spectrum:
        """Return the dominant mode; period and delay [s] and gains are the problem's own unless given."""
        matrix = self.matrix(period, delay, gains)
        values, vectors = np.linalg.eig(matrix)
        free = 2 * (self.n - min(self.n, self.problem.law.task.size))
        order = np.argsort(np.abs(values - 1))
        drifting = [i for i in order[:free] if abs(values[i] - 1) < DRIFT]
        kept = np.setdiff1d(np.arange(values.size), drifting)
        worst = kept[np.argmax(np.abs(values[kept]))]
        T = self.s.period if period is None else period
        modulus, joints = abs(values[worst]), np.abs(vectors[: 2 * self.n, worst])
        return Spectrum(
            radius=float(modulus),
            frequency=abs(float(np.angle(values[worst]))) / (2 * math.pi * T),
            joint=int(np.argmax(joints[: self.n] + joints[self.n :])) + 1,
            decay=-math.log(max(modulus, 1e-300)) / T,
            drifting=len(drifting),
        )

    def matrix(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: dict[str, Array] | None = None,
    ) -> Array:
        """Return the map of (x, what is remembered, commands on their way) over one period."""
        T = self.s.period if period is None else period
        late = self.s.delay if delay is None else delay
        whole = int(late / T + 1e-9)
        part = max(late / T - whole, 0.0)
        C = self._control(T, gains)  # (memory, command) by (x, memory)
        n_x, n_c, n = self.x.size, self.remembered.size, self.n
        lined = whole + (part > 1e-9)
        size = n_x + n_c + lined * n
        command = np.zeros((n, size))
        command[:, : n_x + n_c] = C[n_c:]
        # The command of this period, then those of the periods before it.
        sent = [command] + [np.eye(n, size, n_x + n_c + i * n) for i in range(lined)]
        out = np.zeros((size, size))
        if part > 1e-9:
            early, gain_early = self._held(part * T)
            rest, gain_rest = self._held((1 - part) * T)
            out[:n_x, :n_x] = rest @ early
            out[:n_x] += rest @ gain_early @ sent[whole + 1] + gain_rest @ sent[whole]
        else:
            step, gain = self._held(T)
            out[:n_x, :n_x] = step
            out[:n_x] += gain @ sent[whole]
        out[n_x : n_x + n_c, : n_x + n_c] = C[:n_c]
        for i in range(lined):
            out[n_x + n_c + i * n : n_x + n_c + (i + 1) * n] = sent[i]
        return out

    def _held(self, time: float) -> tuple[Array, Array]:
        """Return Φ and Γ of the plant over `time` under a held command."""
        n_x = self.x.size
        block = np.zeros((n_x + self.n, n_x + self.n))
        block[:n_x, :n_x], block[:n_x, n_x:] = self.A, self.B
        whole = scipy.linalg.expm(block * time)
        return whole[:n_x, :n_x], whole[:n_x, n_x:]

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

    def _control(self, period: float, gains: dict[str, Array] | None) -> Array:
        """Return the derivative of (memory, command) by (x, memory) of one period at rest."""
        control = self.compiled.control
        own = self.parts.gains.unpack(self.problem.gains) | (gains or {})
        numbers = self._replaced(self._replaced(self.numbers, own, "gains"), {"period": period}, "inner")
        memory, row = self._at_rest(own, period)
        n_x = self.x.size

        def evaluate(points: Array) -> Array:
            memories = np.tile(memory, (len(points), 1))
            memories[:, self.remembered] = points[:, n_x:]
            after, command, _ = control.map(points[:, :n_x], memories, row, numbers)
            return np.hstack([after[:, self.remembered], command])

        return _slope(evaluate, np.concatenate([self.x, memory[self.remembered]]))

    def _at_rest(self, gains: dict[str, Array], period: float) -> tuple[Array, Array]:
        """Return memory and row of a loop that has been at rest at the start for long, its tank full."""
        loop, p = self.compiled.loop, self.problem
        K = self.model["joint_stiffness"]
        stretch = p.theta - p.q
        shaped = (
            p.theta if isinstance(p.law, RigidImpedanceLaw) else p.q + K / gains["shaped_stiffness"] * stretch
        )
        home = posture(p.law.robot, shaped, self.model).pose
        plant = self.parts.plant.unpack(self.s.plant)
        tau_a = plant["joint_stiffness"] * stretch
        weight = posture(p.law.robot, p.q, self.model).gravity_torque
        known: dict[str, Any] = {
            "started": 1.0,
            "read_q": p.q,
            "read_theta": p.theta,
            "read_tau_a": tau_a,
            "governed_position": home.position,
            "governed_rotation": home.rotation,
            "held_stiffness": gains["stiffness"],
            "tank_energy": BRIMFUL,
            "last_q": p.q,
            "last_tau_a": tau_a,
            "known_torque": tau_a - weight,
            "observing": 1.0,
            "seen": 1.0,
            "seen_theta": p.theta,
            "seen_deflection": tau_a / K,
            "last_command": self.s.held,
            "given_torque": self.s.held,
        }
        row: dict[str, Any] = {
            "desired_position": home.position,
            "desired_rotation": home.rotation,
            "desired_stiffness": gains["stiffness"],
            "desired_damping": gains["damping"],
            "elapsed": period,
        }
        known |= {f.name: np.tile(self.s.held, (f.shape[0], 1)) for f in loop.memory if f.name == "in_flight"}
        return _packed(loop.memory, known), _packed(loop.row, row)

    def _replaced(self, numbers: Array, values: dict[str, Any], only: str | None = None) -> Array:
        """Return the parameters of the period with the named ones replaced, in every part that has them."""
        out, start = numbers.copy(), 0
        for name, part in zip(self.parts._fields, self.parts, strict=True):
            if only in (None, name):
                for field in part:
                    if field.name in values:
                        where = part.slices[field.name]
                        out[start + where.start : start + where.stop] = np.ravel(values[field.name])
            start += part.size
        return out


def _packed(layout: Layout, known: dict[str, Any]) -> Array:
    return layout.pack({f.name: known.get(f.name, np.zeros(f.shape)) for f in layout})


def _slope(f: Callable[[Array], Array], x: Array) -> Array:
    """Return ∂f/∂x (m, n) by central differences; f maps rows to rows."""
    h = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(x), 1.0) / 10
    values = f(np.vstack([x + np.diag(h), x - np.diag(h)]))
    return ((values[: x.size] - values[x.size :]) / (2 * h[:, None])).T
