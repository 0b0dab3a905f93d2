"""Run a problem through time, restarting at every discontinuity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import MOTION, Motion, Pose, between, hold, pose_at, shifted
from passiflex.control.posture import posture
from passiflex.control.tank import jump_cost
from passiflex.engines.engine import NATIVE, engine_called
from passiflex.errors import SimulationError
from passiflex.loops.closed_loop import ClosedLoop
from passiflex.loops.compiled import CompiledLoop, compiled_loop
from passiflex.loops.recorded import instant_parts
from passiflex.native import Watched, fastest_pole
from passiflex.native.stability import STABILITY_LIMIT
from passiflex.problems.problem import Event, Problem, SampledProblem
from passiflex.runs.run import Recorded, Run, assemble
from passiflex.simulation.integrate import (
    CHECK,
    RESOLVED,
    SAFETY,
    SLOW_POLE,
    Begun,
    Stretch,
    around,
    held_stretch,
    resolved_stretch,
    share_for,
    smooth_stretch,
)
from passiflex.simulation.simulate_sampled import simulate_sampled

Array = NDArray[np.float64]

NOW = 1e-9
"""Two instants closer than this are one [s]."""
NOTHING = 1e-12
"""Energy [J] below which a jump of the reference is round-off."""
MOST_ROWS = 2_000_000


def simulate_problem(problem: Problem, engine: str = NATIVE.name) -> Run:
    """Return the run of a problem.

    A run that leaves the finite numbers, or that the integrator gives up on, is a result too: it ends
    there, and says so in `Run.failure`.

    Parameters
    ----------
    engine: Who moves the plant, a name of `engines.engine.ENGINES`.

    Raises
    ------
    NameUnknownError, MissingExtraError, ValueRangeError
        For an engine that there is not, or that is not installed, or that cannot run this problem.
    SimulationError
        If the start is not finite, or the events do not fit the noise's hold time.
    """
    moving = engine_called(engine)
    moving.require(problem)
    if isinstance(problem, SampledProblem):
        return simulate_sampled(problem, moving)
    return _Simulation(problem).run()


class _Record:
    """Rows of the result: times, and what is known of states, energies and inputs at them."""

    def __init__(self, problem: Problem, states: int, energies: int, inputs: int):
        count = int(problem.duration / problem.output_interval + NOW)
        if count > MOST_ROWS:
            raise SimulationError(
                "too many rows", got=f"{count}", needs=f"at most {MOST_ROWS}", try_="a longer output_interval"
            )
        self.time: Array = np.arange(count + 1, dtype=np.float64) * problem.output_interval
        if problem.duration - self.time[-1] > NOW:
            self.time = np.append(self.time, problem.duration)
        self.states = np.full((self.time.size, states), np.nan)
        self.energies = np.full((self.time.size, energies), np.nan)
        self.inputs = np.zeros((self.time.size, inputs))

    def put(self, rows: NDArray[np.intp] | int, states: Array, energies: Array) -> None:
        self.states[rows], self.energies[rows] = states, energies

    def good_rows(self) -> int:
        """Return the number of rows before the first that is not finite."""
        good = np.isfinite(self.states).all(axis=1)
        return len(good) if good.all() else int(np.argmin(good))


class _Simulation:
    """The walk from event to event: state, energies so far, and rows recorded so far."""

    def __init__(self, problem: Problem):
        self.problem = problem
        self.compiled: CompiledLoop = compiled_loop(ClosedLoop(problem.law, problem.elements))
        loop = self.compiled.loop
        self.state_slices = loop.state.slices
        self.p = problem.numbers
        self.noise = self._draw_noise(loop.law.robot.n)
        self.planned: Motion = hold(problem.home)  # until the first event, which may be a jump
        self.motion = self.planned
        self.began = 0.0
        hand = posture(problem.law.robot, problem.q, problem.parts.unpack("plant", problem.numbers)).pose
        at_rest = loop.plant.at_rest(problem.q, problem.theta, hand)
        self.x = np.concatenate([at_rest, [problem.tank.initial, 0.0]])  # and the clock
        self.energies = np.zeros(loop.energies.size)
        witness = loop.witness
        limits = witness.numbers(problem.law.robot, problem.tank.initial)
        self.watched = Watched(np.zeros(witness.memory.size), np.concatenate([self.p, limits]))
        self.log: list[dict[str, float | str]] = []
        self.record = _Record(problem, self.x.size, loop.energies.size, loop.inputs.size)

    def run(self) -> Run:
        """Return the run."""
        problem, record = self.problem, self.record
        failure = ""
        ends = [e.time for e in problem.events[1:]] + [problem.duration]
        for event, end in zip(problem.events, ends, strict=True):
            if event.motion is not None:
                self._move_reference(event.motion, event.time)
            u = self._inputs(event)
            rows = np.flatnonzero((record.time >= event.time - NOW) & (record.time < end - NOW))
            record.inputs[rows] = u
            if rows.size and record.time[rows[0]] - event.time < NOW:
                record.put(rows[0], self.x, self.energies)
                rows = rows[1:]
            stretch = self._integrate(event, u, np.append(record.time[rows], end))
            record.put(rows, stretch.states[:-1], stretch.energies[:-1])
            self.x, self.energies = stretch.states[-1], stretch.energies[-1]
            self.watched = self.watched._replace(memory=stretch.watched)
            record.inputs[-1] = u
            if stretch.failure:
                failure = stretch.failure
                break
        else:
            record.put(-1, self.x, self.energies)
        if self.noise is not None and problem.noise is not None:
            held = np.minimum(np.round(record.time / problem.noise.hold).astype(int), len(self.noise) - 1)
            record.inputs[:, self.compiled.loop.inputs.slices["torque_noise"]] = self.noise[held]
        good = record.good_rows()
        states, energies = record.states[:good], record.energies[:good]
        outputs: Array = np.asarray(
            self.compiled.outputs.map(states, record.inputs[:good], self.p), dtype=float
        )
        loop = self.compiled.loop
        parts = zip(instant_parts(loop), (states, energies, outputs), strict=True)
        recorded = [Recorded(layout, numbers) for layout, numbers in parts]
        noted = loop.witness.noted(self.watched.memory)
        return assemble(problem, record.time[:good], recorded, self.log, failure, noted, NATIVE.version)

    def _draw_noise(self, n: int) -> Array | None:
        noise = self.problem.noise
        if noise is None:
            return None
        for t in [e.time for e in self.problem.events] + [
            self.problem.duration,
            self.problem.output_interval,
        ]:
            if abs(t / noise.hold - round(t / noise.hold)) > 1e-6:
                raise SimulationError(
                    f"time {t} s does not fall on the noise's grid",
                    needs=f"a multiple of its hold, {noise.hold} s",
                )
        generator = np.random.default_rng(self.problem.seed)
        periods = round(self.problem.duration / noise.hold)
        return generator.normal(0.0, np.sqrt(noise.variance), size=(periods, n))

    def _inputs(self, event: Event) -> Array:
        layout = self.compiled.loop.inputs
        return layout.pack({**layout.zeros(), **self.motion, **event.environment})

    def _integrate(self, event: Event, u: Array, instants: Array) -> Stretch:
        problem, stepper = self.problem, self.compiled.fixed_step
        after = instants - event.time
        begun = Begun(self.energies, self.watched._replace(time=event.time))
        if problem.noise is not None and self.noise is not None:
            lasts = problem.noise.hold
            first, last = round(event.time / lasts), round(instants[-1] / lasts)
            held = np.tile(u, (last - first, 1))
            held[:, self.compiled.loop.inputs.slices["torque_noise"]] = self.noise[first:last]
            rows, share = np.round(after / lasts).astype(int), share_for(SAFETY, problem.tolerance)
            return held_stretch(stepper, self.x, held, self.p, lasts, rows, share, begun)
        pole = fastest_pole(stepper.rhs, self.x, u, self.p)
        share = share_for(RESOLVED, problem.tolerance)

        def resolved(instants: Array, begun: Begun, share: float = share) -> Stretch:
            return resolved_stretch(stepper, self.x, u, self.p, instants, pole, share, begun)

        def smooth(instants: Array, begun: Begun) -> Stretch:
            rhs, tolerance = self.compiled.rhs, problem.tolerance
            return smooth_stretch(rhs, self.x, u, self.p, instants, tolerance, stepper, begun)

        touched = any(element.acts for element in problem.elements)  # dry friction has its own, shorter times
        if pole <= SLOW_POLE and not touched:
            apart = share * STABILITY_LIMIT / max(pole, 1 / problem.duration)
            return self._looked_at(resolved, after, begun, apart)
        stretch = self._looked_at(smooth, after, begun, CHECK)
        # A run that CVODES gives up on is followed to its end by steps that are merely stable.
        return resolved(after, begun, SAFETY) if stretch.failure else stretch

    def _looked_at(
        self, stretch: Callable[[Array, Begun], Stretch], after: Array, begun: Begun, apart: float
    ) -> Stretch:
        """Return a stretch; where its margin was least so far, it is looked at once more, and closer.

        `apart` are the looks of the first time [s].
        """
        whole = stretch(after, begun)
        time = self.compiled.loop.witness.memory.slices["least_margin_time"]
        least = float(whole.watched[time][0]) - begun.watched.time
        if whole.failure or least <= 0:
            return whole
        seen = begun._replace(watched=begun.watched._replace(memory=whole.watched))
        closer = stretch(around(least, apart, float(after[-1])), seen)
        return whole if closer.failure else whole._replace(watched=closer.watched)

    def _potential(self, motion: Motion, clock: float) -> float:
        """Return U [J] at the present state, with the reference at `clock` of `motion`."""
        x = self.x.copy()
        x[self.state_slices["clock"]] = clock
        layout = self.compiled.loop.inputs
        y = self.compiled.outputs(x, layout.pack({**layout.zeros(), **motion}), self.p)
        return float(y[self.compiled.loop.output_layout.slices["cartesian_spring_energy"]][0])

    def _move_reference(self, motion: Motion, time: float) -> None:
        """Start another motion: restart the clock, and charge the exact jump of the potential, at the start as later.

        A motion is planned from where the reference should be. Where the tank has held it back, the motion
        starts from where it is, displaced by the same amount. If the tank cannot pay a whole jump, the
        reference goes as far as it can, and the motion goes on from there.
        """
        clock, planned = self.state_slices["clock"], motion
        now = pose_at(self.motion, float(self.x[clock][0]))
        motion = _displaced(motion, pose_at(self.planned, time - self.began), now)
        motion = self._pay(motion, now, time)
        self.motion = {name: np.asarray(motion[name]) for name in (f.name for f in MOTION)}
        self.planned, self.began = planned, time
        self.x[clock] = 0.0

    def _pay(self, motion: Motion, now: Pose, time: float) -> Motion:
        """Charge the jump from the pose `now` to the start of `motion`, and return the motion that could be paid."""
        tank, level = self.problem.tank, self.state_slices["tank_energy"]
        before = self._potential(self.motion, float(self.x[self.state_slices["clock"]][0]))

        def reached(share: float) -> tuple[Motion, float, float]:
            then = pose_at(motion, 0.0)
            candidate = motion if share == 1.0 else shifted(motion, between(now, then, share))
            stored = self._potential(candidate, 0.0) - before
            return candidate, stored, jump_cost(stored, signed=tank.signed)

        share = 1.0
        if self.problem.law.has_tank:
            budget = max(
                float(self.x[level][0]) - tank.floor, NOTHING
            )  # what costs nothing is always granted
            if reached(1.0)[2] > budget:
                share = _largest(lambda s: reached(s)[2] <= budget)
        motion, stored, cost = reached(share)
        energies = self.compiled.loop.energies.slices
        if self.problem.law.has_tank:
            after = float(self.x[level][0]) - cost
            self.x[level] = min(after, max(tank.cap, float(self.x[level][0])))
            self.energies[energies["drawn"]] += cost
            self.energies[energies["spilled"]] += after - float(self.x[level][0])
        self.energies[energies["reference"]] += stored
        if abs(stored) > NOTHING or share < 1:
            self.log.append({"time": time, "event": "reference jump", "stored_J": stored, "share": share})
        return motion


def _displaced(motion: Motion, planned: Pose, actual: Pose) -> Motion:
    """Return a motion moved by what separates the actual pose from the planned one; as it is if nothing does."""
    shift, turn = actual.position - planned.position, actual.rotation @ planned.rotation.T
    if np.abs(shift).max() < NOW and np.abs(turn - np.eye(3)).max() < NOW:
        return motion
    start = pose_at(motion, 0.0)
    return shifted(motion, Pose(start.position + shift, turn @ start.rotation))


def _largest(affordable: Callable[[float], bool]) -> float:
    """Return the largest share in [0, 1] that is affordable, by 50 bisections from 0 (which always is)."""
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if affordable(middle) else (low, middle)
    return low
