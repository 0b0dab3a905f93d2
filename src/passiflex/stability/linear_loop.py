"""The sampled loop near rest, as matrices of one period: which gains are stable at a rate and delay, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import held_jacobian
from passiflex.loops.compiled import compiled_sampled_loop, interpreted_sampled_loop
from passiflex.problems.problem import Problem, require_sampled
from passiflex.stability.exponential import exponential
from passiflex.stability.law_slope import Gains, LawSlope, differences
from passiflex.stability.loop_at_rest import Standing, standing
from passiflex.stability.modes import Modes, Spectrum
from passiflex.stability.timing import Timing

Array = NDArray[np.float64]

FORGOTTEN = 1e4
"""[1/s] How fast a state fades out that moves nothing."""


class LinearLoop:
    """The linear approximation of a sampled problem at its start, for any rate, delay and gains.

    The plant is discretised exactly under held commands (matrix exponential); the law's part is its derivative
    (`LawSlope`). Left out is what has no linear approximation: resolution, limits,
    Coulomb friction, and a tank that runs empty.

    A delay that is given here is the robot's: the law goes on to predict over the one that it was built
    for. Where the law is to know of it, make the loop of `altered(problem, delay=…)`.

    Parameters
    ----------
    problem: Sampled.
    at: Another robot or posture than the problem's own; the law knows nothing of it.
    native: Whether to compile what is not compiled yet; without, a few evaluations are sooner done.
    """

    def __init__(self, problem: Problem, at: Standing | None = None, *, native: bool = True):
        self.problem = s = require_sampled(problem)
        self.at = at or standing(s)
        self.native = native
        build = compiled_sampled_loop if native else interpreted_sampled_loop
        self.compiled = build(s.loop)
        self.n = problem.law.robot.n
        self.parts = self.compiled.loop.parameters
        self.law = LawSlope(s, self.at, self.compiled)
        self.remembered, self.x = self.law.remembered, self.law.x
        self._flows: dict[float, tuple[Array, Array]] = {}
        self._kin: LinearLoop | None = None

    def spectrum(
        self, period: float | None = None, delay: float | None = None, gains: Gains | None = None
    ) -> Spectrum:
        """Return the dominant mode; period and delay [s] and gains are the problem's own unless given."""
        maps, periods = self.maps(period, delay, gains), len(self.phases)
        mode = self.modes(product(maps), period).dominant(self.n, self.kinetic, maps)
        return mode._replace(radius=mode.radius ** (1 / periods))

    def modes(self, matrix: Array, period: float | None = None) -> Modes:
        """Return the modes of what `matrix` returns."""
        return Modes.of(matrix, self.cycle(period), self.task_jacobian)

    def radius(
        self, period: float | None = None, delay: float | None = None, gains: Gains | None = None
    ) -> float:
        """Return the spectral radius of a period alone, in half the time; drift is no part of it."""
        whole = Modes.radius_of(self.matrix(period, delay, gains), self.cycle(period), self.task_jacobian)
        return float(whole ** (1 / len(self.phases)))

    def holds(self, period: float, delay: float, gains: Gains) -> bool:
        """Return whether `radius` is below 1, sooner."""
        return Modes.stable_of(self.matrix(period, delay, gains), self.cycle(period), self.task_jacobian)

    def trembling(self, delay: float, gains: Gains, settling: float) -> float:
        """Return the radius of what trembles, as `Modes.trembling_of` has it."""
        matrix = self.matrix(None, delay, gains)
        return Modes.trembling_of(matrix, self.cycle(), self.task_jacobian, settling)

    @cached_property
    def phases(self) -> tuple[bool, ...]:
        """Return of each period of a cycle whether the outer loop runs in it; where it has no own clock, it is one."""
        return (True, *(False for _ in range(self.problem.task_periods - 1)))

    def cycle(self, period: float | None = None) -> float:
        """Return how long a cycle takes [s]."""
        return len(self.phases) * (self.problem.period if period is None else period)

    def matrix(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: Gains | None = None,
        lined: int = 0,
    ) -> Array:
        """Return the map of (x, what is remembered, commands on their way) over one cycle.

        With room for at least `lined` commands, so that maps of other delays are as large.
        """
        return product(self.maps(period, delay, gains, lined))

    def maps(
        self,
        period: float | None = None,
        delay: float | None = None,
        gains: Gains | None = None,
        lined: int = 0,
    ) -> list[Array]:
        """Return the maps of the periods of a cycle, in their order."""
        timing = self.timing(period, delay, lined)
        flow, of = self.flow(timing), dict[bool, Array]()
        for due in dict.fromkeys(self.phases):
            of[due] = flow @ self.runs(timing, gains, due=due)
        return [of[due] for due in self.phases]

    def runs(
        self,
        timing: Timing,
        gains: Gains | None = None,
        elapsed: float | None = None,
        *,
        noise: bool = False,
        due: bool = True,
    ) -> Array:
        """Return what the law does at a sample: (x, memory, commands) → the same with its own command first.

        `elapsed` [s] is the time since it last ran, one period unless given. With noise, further columns.
        An outer loop with its own clock runs if it is `due`.
        """
        law = self._control(timing.period, elapsed or timing.period, dict(gains or {}), noise, due)
        n, told = self.n, self._told
        heard = law.shape[1] - told
        out = np.zeros((told + (timing.lined + 1) * n, told + timing.lined * n + heard))
        out[: self.x.size, : self.x.size] = np.eye(self.x.size)
        out[self.x.size : told + n, :told] = law[:, :told]
        out[self.x.size : told + n, told + timing.lined * n :] = law[:, told:]
        out[told + n :, told : told + timing.lined * n] = np.eye(timing.lined * n)
        return out

    def misses(self, timing: Timing) -> Array:
        """Return what a sample does at which the law does not run: the last command goes on, nothing is remembered."""
        n, told = self.n, self._told
        out = np.zeros((told + (timing.lined + 1) * n, told + timing.lined * n))
        out[:told, :told] = np.eye(told)
        out[told + n :, told:] = np.eye(timing.lined * n)
        out[told : told + n, told : told + n] = np.eye(n)
        return out

    def flow(self, timing: Timing) -> Array:
        """Return what a period does after its sample: the plant moves, the commands come nearer."""
        n, n_x, told = self.n, self.x.size, self._told
        out = np.zeros((told + timing.lined * n, told + (timing.lined + 1) * n))

        def sent(ago: int) -> slice:
            return slice(told + ago * n, told + (ago + 1) * n)

        if timing.part:
            early, gain_early = self.held(timing.part * timing.period)
            rest, gain_rest = self.held((1 - timing.part) * timing.period)
            out[:n_x, :n_x] = rest @ early
            out[:n_x, sent(timing.whole + 1)] = rest @ gain_early
            out[:n_x, sent(timing.whole)] += gain_rest
        else:
            out[:n_x, :n_x], out[:n_x, sent(timing.whole)] = self.held(timing.period)
        out[n_x:told, n_x:told] = np.eye(told - n_x)
        out[told:, told : told + timing.lined * n] = np.eye(timing.lined * n)
        return out

    def without_actions(self) -> LinearLoop:
        """Return the loop with the tank's valve shut."""
        still = {
            name: np.zeros(self.n)
            for name in ("posture_stiffness", "posture_damping", "viscous_compensation")
        }
        return LinearLoop(self.problem.with_numbers(still, "actions"), self.at, native=self.native)

    def fallback(self) -> dict[str, Array]:
        """Return the gains of the law that takes over when the tank is overdrawn."""
        return self.parts.unpack("fallback", self.problem.numbers)

    def beside(self, at: Standing) -> LinearLoop:
        """Return the loop of another robot at the same posture, which makes its law's derivative from this one's.

        The law sees the robot by its readings only: K and D of τ_a = K (θ − q) + D (θ̇ − q̇). Exact where no weight
        is carried; where one is, the law's point of rest is taken to be this one's.
        """
        other = LinearLoop(self.problem, at, native=self.native)
        other._kin = self
        return other

    def heard(self, at: Standing, period: float, gains: Gains, *, due: bool = True) -> Array:
        """Return what another robot's τ_a adds to the law's derivative by x: it is all that the law sees of a robot."""
        return self._heard((self._kin or self).law.torque(at) - self._torque, period, period, gains, due)

    def _heard(self, torque: Array, period: float, elapsed: float, gains: Gains, due: bool) -> Array:
        by_torque = (self._kin or self).law.by(period, elapsed, gains, due=due)[:, self._told :]
        return np.asarray(by_torque[:, : self.n] @ torque)

    @cached_property
    def _torque(self) -> Array:
        """Return ∂τ_a/∂x of this robot, as the law hears it."""
        return (self._kin or self).law.torque(self.at)

    def plants(self, others: Sequence[Standing]) -> Array:
        """Return [A B] of other robots, or of this one elsewhere (M, N, N + n): all by one call of compiled code."""
        plant = self.compiled.loop.plant
        where = [np.concatenate([plant.at_rest(at.q, at.theta, at.arm.pose), at.held]) for at in others]
        points, steps = zip(*(differences(x) for x in where), strict=True)
        rows = np.vstack(points)
        numbers = np.repeat([self._smooth(at) for at in others], len(points[0]), axis=0)
        u = np.hstack([rows[:, self.x.size :], np.zeros((len(rows), plant.environment.size))])
        values = self.compiled.plant.map(rows[:, : self.x.size], u, numbers)[0]
        split = values.reshape(len(others), 2, len(steps[0]), -1)
        change = (split[:, 0] - split[:, 1]) / (2 * np.array(steps))[:, :, None]
        return _without_counters(np.asarray(change.transpose(0, 2, 1)), 4 * self.n)

    @cached_property
    def task_jacobian(self) -> Array:
        """Return the task's Jacobian here (k, n), its lengths in units of the arm's reach."""
        task, J = self.problem.law.task, held_jacobian(self.problem.law.task, self.at.arm)
        reach = max(float(np.linalg.norm(self.at.arm.jacobian[:3], axis=0).max()), 1e-12)
        return np.asarray(J / np.array([reach if axis < 3 else 1.0 for axis in task.held])[:, None])

    @property
    def kinetic(self) -> Array:
        """Return the inertia of links and motors (2n,): what each joint moves, the others held [kg m²]."""
        motors = self.parts["plant"].unpack(self.at.plant)["motor_inertia"]
        return np.concatenate([np.diag(self.at.arm.mass_matrix), motors])

    @property
    def _told(self) -> int:
        """Return the size of (x, what is remembered)."""
        return self.x.size + self.remembered.size

    def timing(self, period: float | None = None, delay: float | None = None, lined: int = 0) -> Timing:
        """Return a timing, with the problem's own period and delay [s] unless given."""
        T = self.problem.period if period is None else period
        return Timing.of(T, self.problem.delay if delay is None else delay, lined)

    @cached_property
    def plant(self) -> Array:
        """Return [A B] of the plant at rest."""
        return np.asarray(self.plants([self.at])[0])

    def _smooth(self, at: Standing) -> Array:
        """Return a robot's numbers without dry friction."""
        layout = self.parts["plant"]
        return layout.pack(layout.unpack(at.plant) | {"coulomb_friction": np.zeros(self.n)})

    def held(self, time: float) -> tuple[Array, Array]:
        """Return Φ and Γ of the plant over `time` under a held command."""
        if time not in self._flows:
            n_x = self.x.size
            block = np.zeros((n_x + self.n, n_x + self.n))
            block[:n_x] = self.plant
            whole = exponential(block * time)
            self._flows[time] = whole[:n_x, :n_x], whole[:n_x, n_x:]
        return self._flows[time]

    def _control(self, period: float, elapsed: float, gains: Gains, noise: bool, due: bool) -> Array:
        """Return the law's derivative, by the noise too if wanted."""
        kin = self._kin
        found = (kin or self).law.by(period, elapsed, gains, due=due)
        if kin is not None:
            found = found.copy()
            found[:, : self.x.size] += kin._heard(self._torque - kin._torque, period, elapsed, gains, due)
        return found if noise else found[:, : self._told]


def product(maps: Sequence[Array]) -> Array:
    """Return what one map after the other does; the first is the first."""
    return reduce(lambda done, then: np.asarray(then @ done), maps)


def _without_counters(plants: Array, robot: int) -> Array:
    """Return [A B] in which states of elements that move nothing, themselves included, fade out.

    A counter of heat or way, the anchor of a wall that is not touched: it goes on or stays, and that is no instability.
    """
    counts = np.asarray(~plants[:, :, robot : plants.shape[1]].any(axis=1))
    for i in range(counts.shape[1]):
        plants[counts[:, i], robot + i, robot + i] = -FORGOTTEN
    return plants
