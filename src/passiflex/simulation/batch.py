"""Run many sampled problems side by side in lanes; each gives the numbers that it gives alone."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from passiflex.engines.engine import NATIVE
from passiflex.errors import NameUnknownError, SimulationError
from passiflex.loops.compiled import CompiledSampledLoop, compiled_sampled_loop, structure
from passiflex.loops.recorded import sample_parts
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.loops.witness import Noted, Witness
from passiflex.native import Change, LaneFunctions, LaneInputs, LaneLoop, find_compiler
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.problems.unbooked import unbooked
from passiflex.runs.run import Recorded, Run, assemble
from passiflex.simulation.recording import Recording, books_kept
from passiflex.simulation.schedule import Chance, Scheduled, schedule
from passiflex.simulation.simulate_sampled import (
    left_finite,
    longest_step,
    sample_count,
    simulate_unchecked,
    start,
)
from passiflex.stability.noise_credit import charged

Array = NDArray[np.float64]
T = TypeVar("T")

CHUNK = 2048
"""Periods that are made ready at a time."""

_lane_loops: dict[tuple[Hashable, int | None], LaneLoop] = {}


def simulate_batch(
    problems: Sequence[Problem], keep: Sequence[str], *, threads: int = 1, width: int | None = None
) -> list[Recording]:
    """Return the recordings of sampled problems, in their order; see `digest_batch`."""
    return digest_batch(problems, keep, lambda i, recording: recording, threads=threads, width=width)


def digest_batch(
    problems: Sequence[Problem],
    keep: Sequence[str],
    digest: Callable[[int, Recording], T],
    *,
    threads: int = 1,
    width: int | None = None,
) -> list[T]:
    """Return what `digest` makes of the number and the recording of each sampled problem, in their order.

    Problems of the same structure and timing share the lanes of one native loop; what comes out does not
    depend on which, nor on the number of lanes or threads. A problem whose state leaves the finite numbers
    ends there and says so. Whether a loop is stable is not asked. Recordings are dropped once they are
    digested, so that memory does not grow with the number of problems.

    Parameters
    ----------
    problems: All of them with a control rate.
    keep: Names of the signals to record, of those that a `Run` has.
    threads: How many native loops run at a time; `digest` is called from all of them.
    width: Lanes of one loop; by the processor if None. Without a C compiler the problems run one by one.

    Raises
    ------
    SimulationError
        For a problem in continuous time.
    NameUnknownError
        For a signal that there is not.
    """
    sampled = [_sampled(problem) for problem in problems]
    if find_compiler() is None:
        return [digest(i, _alone(problem, keep)) for i, problem in enumerate(sampled)]
    groups: defaultdict[Hashable, list[int]] = defaultdict(list)
    steps = [longest_step(p, _compiled(p).plant) for p in sampled]
    for i, problem in enumerate(sampled):
        groups[_alike(problem)].append(i)
    jobs = []
    for group in groups.values():
        loop = lane_loop(sampled[group[0]], width)
        group.sort(key=lambda i: steps[i])  # lanes that take as many steps as each other wait for none
        jobs += [(loop, group[i : i + loop.width]) for i in range(0, len(group), loop.width)]

    def run(job: tuple[LaneLoop, list[int]]) -> list[tuple[int, T]]:
        loop, members = job
        longest = np.array([steps[i] for i in members])
        recordings = _advance(loop, [sampled[i] for i in members], longest, keep)
        return [(i, digest(i, recording)) for i, recording in zip(members, recordings, strict=True)]

    with ThreadPoolExecutor(threads) as pool:
        found = dict(pair for done in pool.map(run, jobs) for pair in done)
    return [found[i] for i in range(len(problems))]


def _sampled(problem: Problem) -> SampledProblem:
    if not isinstance(problem, SampledProblem):
        raise SimulationError(f"{problem.name!r} has no control rate", needs="`control: {rate: …}`")
    return problem


def lane_loop(problem: SampledProblem, width: int | None = None) -> LaneLoop:
    """Return the native lanes for problems of this structure; from the process, the cache on disk, or compiled now."""
    key = (structure(problem.loop), width)
    if key not in _lane_loops:
        loop = _compiled(problem).loop
        functions = LaneFunctions(
            loop.plant.rhs, loop.control, loop.period.function, loop.outputs, loop.watch
        )
        _lane_loops[key] = LaneLoop(functions, width)
    return _lane_loops[key]


def _compiled(problem: SampledProblem) -> CompiledSampledLoop:
    return compiled_sampled_loop(problem.loop)


def _alike(problem: SampledProblem) -> Hashable:
    """Return what problems have in common that can share lanes."""
    return structure(problem.loop), problem.period, problem.duration, problem.output_interval


def _alone(problem: SampledProblem, keep: Sequence[str]) -> Recording:
    run = simulate_unchecked(problem)
    known = [str(name) for name, signal in run.data.data_vars.items() if "time" in signal.dims]
    for name in keep:
        if name not in known:
            raise NameUnknownError("signal", name, known)
    noted = {f.name: run[f.name] for f in _compiled(problem).loop.witness.extremes}
    signals = {name: run[name] for name in keep}
    elements = books_kept(problem, keep)
    return Recording(signals, run.time, run.failure, run.has_tank, run.unbooked, noted, elements)


def _advance(
    lanes: LaneLoop, problems: list[SampledProblem], longest: Array, keep: Sequence[str]
) -> list[Recording]:
    """Return the recordings of at most as many problems as there are lanes; lanes left over repeat the last."""
    filled = [*problems, *[problems[-1]] * (lanes.width - len(problems))]
    longest = np.concatenate([longest, np.full(lanes.width - len(problems), longest[-1])])
    compiled = _compiled(problems[0])
    s = problems[0]
    every = round(problems[0].output_interval / s.period)
    columns, shapes = _columns(lanes, compiled.loop, keep)
    witness = compiled.loop.witness
    p_plant, p_control, p_watch = _lane_numbers(filled, witness)
    state = lanes.start([start(p, compiled) for p in filled])
    told = [schedule(p, compiled.loop.period) for p in filled]
    chances = [Chance(p, compiled.loop.period) for p in filled]
    samples, chunk = sample_count(problems[0]), max(1, CHUNK // every) * every
    ended, whole = np.full(lanes.width, samples), np.zeros(lanes.width, dtype=np.int64)
    values = np.full((len(problems), -(-samples // every), columns.size), np.nan)
    for first in range(0, samples, chunk):
        count = min(chunk, samples - first)
        drawn, timing = zip(*(chance.take(first, count) for chance in chances), strict=True)
        inputs = LaneInputs(
            first, _changes(told, first, first + count), np.stack(drawn, axis=-1), np.stack(timing, axis=-1)
        )
        done = lanes.advance(
            state,
            inputs,
            p_plant,
            p_control,
            s.period,
            longest,
            columns,
            every,
            last=first + count == samples,
            p_watch=p_watch,
        )
        state = done.state
        begin = first // every
        values[:, begin : begin + len(done.values)] = done.values.transpose(2, 0, 1)[: len(problems)]
        whole += np.where(whole == begin, done.whole, 0)
        left = (done.completed < count) & (ended == samples)
        ended[left] = first + done.completed[left]
        if (ended < samples).all():
            break
    return [
        _recording(
            p,
            values[lane],
            shapes,
            int(ended[lane]),
            int(whole[lane]),
            samples,
            witness.noted(state.watched[:, lane]),
        )
        for lane, p in enumerate(problems)
    ]


def _lane_numbers(problems: list[SampledProblem], witness: Witness) -> tuple[Array, Array, Array]:
    """Return the numbers of plant, control and watch, a column for each lane."""
    numbers = [charged(p) for p in problems]
    plant = np.stack([n.plant for n in numbers], axis=1)
    control = np.stack([n.numbers for n in numbers], axis=1)
    watched = np.stack([witness.numbers(p.law.robot, p.tank.initial) for p in problems], axis=1)
    return plant, control, np.concatenate([control, watched])


def _changes(told: list[list[Scheduled]], begin: int, end: int) -> list[Change]:
    return [
        Change(scheduled.first, lane, scheduled.numbers)
        for lane, list_of in enumerate(told)
        for scheduled in list_of
        if begin <= scheduled.first < end
    ]


def _columns(
    lanes: LaneLoop, loop: SampledLoop, keep: Sequence[str]
) -> tuple[NDArray[np.int64], dict[str, tuple[slice, tuple[int, ...]]]]:
    """Return which numbers of a sample to keep, and of what is kept where each signal stands, with its shape."""
    where = {}
    for part, layout in sample_parts(loop).items():
        begin = lanes.instant[part].start
        for f in layout.kept:
            own = layout.slices[f.name]
            where[f.name] = np.arange(begin + own.start, begin + own.stop), f.shape
    columns: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]  # of no signals
    shapes, end = {}, 0
    for name in keep:
        if name not in where:
            raise NameUnknownError("signal", name, list(where))
        numbers, shape = where[name]
        columns.append(numbers)
        shapes[name] = slice(end, end := end + numbers.size), shape
    return np.concatenate(columns), shapes


def _recording(
    problem: SampledProblem,
    values: Array,
    shapes: dict[str, tuple[slice, tuple[int, ...]]],
    ended: int,
    whole: int,
    samples: int,
    noted: Noted,
) -> Recording:
    """Return what was kept of one lane; energies may leave the finite numbers before states do."""
    every = round(problem.output_interval / problem.period)
    count = len(values) if ended == samples else max(1, min(whole, ended // every + 1))
    signals = {
        name: values[:count, columns].reshape(count, *shape) for name, (columns, shape) in shapes.items()
    }
    time = np.arange(count, dtype=np.float64) * (problem.period * every)
    failure = "" if ended == samples else left_finite(ended * problem.period)
    elements = books_kept(problem, signals)
    has_tank, missed = problem.law.has_tank, unbooked(problem)
    return Recording(signals, time, failure, has_tank, missed, noted.values, elements)


def simulate_in_lane(problem: SampledProblem) -> Run:
    """Return the whole run of a sampled problem with the very numbers that it has in a batch.

    `simulate` gives the same but for rounding, which a sensor's resolution or an unstable loop makes visible.
    """
    loop = _compiled(problem).loop
    layouts = [layout.kept for layout in sample_parts(loop).values()]
    (recording,) = simulate_batch([problem], [f.name for layout in layouts for f in layout])
    rows = [
        Recorded(layout, np.hstack([recording[f.name].reshape(len(recording.time), f.size) for f in layout]))
        for layout in layouts
    ]
    noted = Noted(loop.witness.extremes, recording.noted)
    return assemble(problem, recording.time, rows, [], recording.failure, noted, NATIVE.version)
