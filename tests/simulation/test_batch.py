"""Problems side by side in lanes: each gives what it gives alone, whatever runs beside it."""

from __future__ import annotations

import dataclasses
import weakref
from typing import Any

import numpy as np
import pytest

from passiflex.errors import NameUnknownError, SimulationError
from passiflex.loops.compiled import compiled_sampled_loop
from passiflex.native import find_compiler
from passiflex.problems.altered import altered
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.simulation import Run, batch, resolve
from passiflex.simulation.batch import digest_batch, lane_loop, simulate_batch
from passiflex.simulation.recording import Recording
from passiflex.simulation.simulate_sampled import longest_step, simulate_unchecked
from passiflex.studies.paper import shipped_scenario
from worlds import PERIOD, merged, world

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no compiler")
EPS = float(np.finfo(float).eps)
REAL: dict[str, Any] = {
    "law": {
        "shaped_inertia": {"ratio": 0.4},
        "stiffness": {"translation": 100},
        "damping": {"translation": 30},
    },
    "control": {"delay": 1e-3, "jitter": 4e-4, "missed": 0.02},
    "sensors": {"velocity": "differences", "velocity_filter": 150},
    "noise": {"torque_variance": 0.1, "hold": 2e-3},
    "forces": [{"from": 0.2, "to": 0.3, "force": [1, 0, 2]}],
    "drags": [{"from": 0.15, "to": 0.4, "viscous": 3, "dry": 0.2}],
    "duration": 0.5,
}
"""Everything that differs from run to run: chance, late and missed periods, events."""


def varied(problem: Problem, count: int, seed: int = 1) -> list[Problem]:
    """Return so many robots that are not quite the same, with other chance."""
    rng = np.random.default_rng(seed)
    plant = problem.law.robot.layout.unpack(problem.plant)
    found = []
    for i in range(count):
        changes = {n: plant[n] * rng.uniform(0.8, 1.25) for n in ("joint_stiffness", "motor_inertia")}
        found.append(dataclasses.replace(altered(problem, plant=changes), seed=100 + i))
    return found


def signals(run: Run) -> list[str]:
    return [str(name) for name, signal in run.data.data_vars.items() if "time" in signal.dims]


def same(one: Recording, other: Recording | Run) -> bool:
    """Return whether two recordings are the same to the last bit, in what the first has."""
    assert one.failure == other.failure
    np.testing.assert_array_equal(one.time, other.time)
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.signals)


def all_same(ours: list[Recording], theirs: list[Recording]) -> bool:
    assert len(ours) == len(theirs)
    return all(same(a, b) for a, b in zip(ours, theirs, strict=True))


def close(ours: Recording, run: Run, inertia: float) -> None:
    """Compare a problem in lanes with the same alone, each signal relative to what its kind has at most.

    Angles, poses and energies agree to 1e-12. The law takes velocities from differences over a period T, so a
    rounding eps |q| of an angle becomes eps |q| / T of a velocity; the motor's torque changes a velocity within
    a period, so that becomes B eps |q| / T² of it. The loop is stable and hands on a few of these: ten at most.
    """
    assert ours.failure == run.failure == ""
    np.testing.assert_array_equal(ours.time, run.time)
    rounding = EPS * max(1.0, np.abs(run["theta"]).max())
    velocity, torque = 10 * rounding / PERIOD, 10 * inertia * rounding / PERIOD**2
    fastest, strongest = (
        max(np.abs(run[n]).max() for n in names) for names in (("dq", "dtheta"), ("tau_m", "tau_a"))
    )
    energy = max(np.abs(run[name]).max() for name in signals(run) if name.endswith("_energy"))
    for name in signals(run):
        if name.endswith(("dq", "dtheta", "dphi")):
            bound = velocity
        elif run.data[name].attrs["units"] == "N m":
            bound = torque
        elif name.endswith("_power"):
            bound = run["q"].shape[1] * (torque * fastest + velocity * strongest)
        else:
            bound = 1e-12 * max(np.abs(run[name]).max(), energy if name.endswith("_energy") else 0.0)
        assert np.abs(ours[name] - run[name]).max() <= bound, name


@pytest.fixture(scope="module")
def planar() -> Problem:
    return resolve(world(**REAL))


@pytest.fixture(scope="module")
def fleet(planar: Problem) -> list[Problem]:
    return varied(planar, 11)


@pytest.fixture(scope="module")
def alone(fleet: list[Problem]) -> list[Run]:
    return [simulate_unchecked(problem) for problem in fleet]


@pytest.fixture(scope="module")
def together(fleet: list[Problem], alone: list[Run]) -> list[Recording]:
    return simulate_batch(fleet, signals(alone[0]))


@needs_compiler
def test_lanes_record_what_runs_alone_have(alone: list[Run], together: list[Recording]) -> None:
    for ours, run in zip(together, alone, strict=True):
        assert set(ours.signals) == set(signals(run))
        assert ours.has_tank == run.has_tank
        assert ours.sampled == run.sampled
        for name in ours.signals:
            assert ours[name].shape == run[name].shape
        close(ours, run, 0.5 * 1.25)
    assert not same(together[0], together[1])


@needs_compiler
@pytest.mark.parametrize("how", [{"threads": 2}, {"width": 4}, {"width": 8}, {"width": 4, "threads": 2}])
def test_lanes_and_threads_change_nothing(fleet: list[Problem], together: list[Recording], how: Any) -> None:
    assert all_same(simulate_batch(fleet, list(together[0].signals), **how), together)


@needs_compiler
def test_the_number_of_lanes_is_the_one_asked_for(planar: Problem) -> None:
    assert [lane_loop(planar, width).width for width in (4, 8, 4)] == [4, 8, 4]
    assert lane_loop(planar, 4) is lane_loop(planar, 4)


@needs_compiler
def test_each_takes_steps_of_its_own_length(planar: Problem) -> None:
    """Joints up to 40 times as stiff need up to six steps in a period where others need one."""
    fleet = [
        dataclasses.replace(altered(planar, plant={"joint_stiffness": [k, k]}), duration=0.2)
        for k in (200e3, 5e3, 80e3, 4e3, 40e3, 6e3)
    ]
    assert isinstance(planar, SampledProblem)
    plant = compiled_sampled_loop(planar.loop).plant
    steps = [int(np.ceil(PERIOD / longest_step(problem, plant))) for problem in fleet]
    assert len(set(steps)) >= 3
    keep = ["q", "dq", "theta", "tank_energy", "joint_spring_energy"]
    for ours, problem in zip(simulate_batch(fleet, keep), fleet, strict=True):
        run = simulate_unchecked(problem)
        for name in keep:
            atol = 1e-10 * np.abs(run[name]).max()
            np.testing.assert_allclose(ours[name], run[name], rtol=0, atol=atol, err_msg=name)


@needs_compiler
def test_order_and_company_change_nothing(fleet: list[Problem], together: list[Recording]) -> None:
    """Each by itself, all in another order, and some of them twice."""
    keep = list(together[0].signals)
    assert all_same([simulate_batch([problem], keep)[0] for problem in fleet], together)
    order = [int(i) for i in np.random.default_rng(4).permutation(11)] + [3, 3, 0]
    assert all_same(simulate_batch([fleet[i] for i in order], keep), [together[i] for i in order])


@needs_compiler
@pytest.mark.parametrize("chunk", [1, 64, 300, 501])
def test_pieces_change_nothing(
    fleet: list[Problem], together: list[Recording], chunk: int, monkeypatch: Any
) -> None:
    """Events, noise that lasts, missed periods and commands on their way go from one chunk to the next."""
    monkeypatch.setattr(batch, "CHUNK", chunk)
    assert all_same(simulate_batch(fleet, list(together[0].signals)), together)


@needs_compiler
@pytest.mark.parametrize("chunk", [2048, 100])
def test_records_are_every_so_many_periods(
    fleet: list[Problem], together: list[Recording], chunk: int, monkeypatch: Any
) -> None:
    """Whole chunks begin with a record; the last sample is one only if its turn comes."""
    monkeypatch.setattr(batch, "CHUNK", chunk)
    thin = [dataclasses.replace(problem, output_interval=7e-3) for problem in fleet]
    keep = list(together[0].signals)
    for ours, whole, problem in zip(simulate_batch(thin, keep), together, thin, strict=True):
        for name in keep:
            np.testing.assert_array_equal(ours[name], whole[name][::7])
        np.testing.assert_array_equal(ours.time, simulate_unchecked(problem).time)


@needs_compiler
def test_a_recording_has_what_was_asked_for_and_no_more(
    fleet: list[Problem], together: list[Recording]
) -> None:
    keep = ["rotation", "q", "tank_energy"]
    found = simulate_batch(fleet[:3], keep)
    for ours, whole in zip(found, together[:3], strict=True):
        assert list(ours.signals) == keep
        assert same(ours, whole)
    assert found[0]["rotation"].shape == (501, 3, 3)
    assert found[0]["tank_energy"].shape == (501,)
    [bare] = simulate_batch(fleet[:1], [])
    assert (bare.signals, bare.time.size) == ({}, 501)
    assert simulate_batch([], keep) == []


@needs_compiler
def test_problems_of_other_structure_and_timing_run_in_one_batch(
    fleet: list[Problem], together: list[Recording]
) -> None:
    """Another rate, duration, recording, law, delay; each has its own lanes or shares them."""
    law = {"law": {"gravity": "robot", "task": "position"}, "tank": {"kind": "paper"}}
    others = [
        resolve(world(**merged(REAL, change)))
        for change in (
            {"control": {"rate": 2000}, "noise": {"hold": 1e-3}},
            {"duration": 0.3004},
            {"output_interval": 5e-3},
            {"control": {"delay": 2.3e-3}, "law": {"shaped_inertia": {"ratio": 0.7}}},
            law,
        )
    ]  # fmt: skip
    keep = ["q", "tau_m", "tank_energy", "measured_dq", "position"]
    mixed = [others[0], fleet[0], others[1], fleet[1], *others[2:]]
    found = simulate_batch(mixed, keep, threads=2)
    for ours, problem in zip(found, mixed, strict=True):
        run = simulate_unchecked(problem)
        np.testing.assert_array_equal(ours.time, run.time)
        for name in keep:
            atol = 1e-9 * np.abs(run[name]).max()
            np.testing.assert_allclose(ours[name], run[name], rtol=0, atol=atol)
    for name in keep:
        np.testing.assert_array_equal(found[1][name], together[0][name])
        np.testing.assert_array_equal(found[3][name], together[1][name])


@needs_compiler
def test_with_quantised_angles_lanes_agree_among_themselves() -> None:
    """An angle on the edge of a quantum may fall to either side by its last bit: then a run alone sees a velocity
    that differs by quantum / T, and all that follows is another, equally right, run. In lanes, it is the same one.
    """
    coarse = {"sensors": {"link_resolution": 1e-4, "motor_resolution": 1e-6}}
    fleet = varied(resolve(world(**merged(REAL, coarse))), 5)
    keep = ["q", "measured_q", "measured_dq", "tau_m", "tank_energy"]
    found = simulate_batch(fleet, keep)
    assert all_same(simulate_batch(fleet[::-1], keep, threads=2), found[::-1])
    assert all_same(simulate_batch(fleet, keep, width=4), found)
    assert all_same([simulate_batch([problem], keep)[0] for problem in fleet], found)
    steps = found[0]["measured_q"] / 1e-4
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)
    for ours, problem in zip(found, fleet, strict=True):
        run = simulate_unchecked(problem)
        np.testing.assert_allclose(ours["q"], run["q"], rtol=0, atol=1e-4)


@needs_compiler
@pytest.mark.parametrize("compiler", ["", "none"])
def test_a_digest_gets_each_recording_with_its_number(
    fleet: list[Problem], together: list[Recording], compiler: str, monkeypatch: Any
) -> None:
    """Once, whatever the order in which they are done; what it raises reaches the caller."""
    monkeypatch.setenv("PASSIFLEX_COMPILER", compiler)
    seen = []

    def digest(i: int, recording: Recording) -> tuple[int, float]:
        seen.append(i)
        return i, float(recording["q"][-1, 0])

    found = digest_batch(fleet, ["q"], digest, threads=2)
    assert sorted(seen) == list(range(11))
    assert [i for i, _ in found] == list(range(11))
    ends = [r["q"][-1, 0] for r in together]
    np.testing.assert_allclose([end for _, end in found], ends, rtol=1e-11)

    def broken(i: int, recording: Recording) -> None:
        raise KeyError(i)

    with pytest.raises(KeyError):
        digest_batch(fleet, ["q"], broken, threads=2)


@needs_compiler
def test_a_recording_is_dropped_once_it_is_digested(fleet: list[Problem]) -> None:
    alive: list[weakref.ref[Recording]] = []
    most = 0

    def digest(i: int, recording: Recording) -> None:
        nonlocal most
        alive.append(weakref.ref(recording))
        most = max(most, sum(r() is not None for r in alive))

    digest_batch(fleet * 2, ["q"], digest, width=4)
    assert len(alive) == 22
    assert most <= 8  # those of one loop, and of the one before while its successor is under way


# Runs that end early

PAPER: dict[str, Any] = {
    "law": {"shaped_stiffness": {"ratio": 10}, "shaped_inertia": {"ratio": 0.01}},
    "control": {"external_torque": "measured", "delay": 1e-3, "allow_unstable": True},
    "tank": {"kind": "paper"},
    "reference": [
        {"at": 0, "kind": "step", "by": [0, 0, 0.05]}
    ],  # at once: at rest, round-off would be what grows
}
CALM: dict[str, Any] = merged(
    PAPER, {"law": {"shaped_stiffness": {"ratio": 1}, "shaped_inertia": {"ratio": 0.4}}}
)


@needs_compiler
@pytest.mark.parametrize("chunk", [2048, 50])
@pytest.mark.parametrize("interval", [1e-3, 4e-3])
def test_a_run_that_leaves_the_finite_numbers_ends_as_alone(
    chunk: int, interval: float, monkeypatch: Any
) -> None:
    """With the same words and rows, in lanes with others that go on, and with others that end elsewhere."""
    monkeypatch.setattr(batch, "CHUNK", chunk)
    every = {"output_interval": interval}
    wild = [
        resolve(world(**merged(PAPER, every | c))) for c in ({}, {"law": {"damping": {"translation": 4000}}})
    ]
    calm = varied(resolve(world(**merged(CALM, every))), 4)
    keep = ["q", "dq", "tau_m", "tank_energy"]
    without = simulate_batch(calm, keep)
    found = simulate_batch([wild[0], *calm[:2], wild[1], *calm[2:]], keep)
    assert all_same([found[i] for i in (1, 2, 4, 5)], without)
    assert all(not r.failure and len(r.time) == round(0.6 / interval) + 1 for r in without)
    for ours, problem in zip((found[0], found[3]), wild, strict=True):
        run = simulate_unchecked(problem)
        assert "left the finite numbers" in run.failure
        assert ours.failure == run.failure
        np.testing.assert_array_equal(ours.time, run.time)
        assert ours["q"].shape == run["q"].shape
        np.testing.assert_allclose(ours["q"][: len(run.time) // 2], run["q"][: len(run.time) // 2], rtol=1e-9)
    assert all_same(simulate_batch(wild, keep), [found[0], found[3]])  # no lane is left: the loop ends


# What is refused, and what runs without lanes


def test_a_problem_in_continuous_time_is_refused(planar: Problem) -> None:
    continuous = resolve(world(control=None, tank={"kind": "paper"}))
    with pytest.raises(SimulationError, match=r"'planar' has no control rate; needs `control: \{rate: …\}`"):
        simulate_batch([planar, continuous], ["q"])


@pytest.mark.parametrize("compiler", ["", "none"])
def test_an_unknown_signal_is_named_with_the_nearest(
    planar: Problem, compiler: str, monkeypatch: Any
) -> None:
    """So is what a run has, but not as a signal over time; with lanes and without."""
    short = dataclasses.replace(planar, duration=0.01)
    simulate_unchecked(short)
    monkeypatch.setenv("PASSIFLEX_COMPILER", compiler)
    for wrong, nearest in (("tank_enrgy", "tank_energy"), ("torque_limits", "")):
        with pytest.raises(NameUnknownError, match=rf"signal.*{wrong}.*{nearest}"):
            simulate_batch([short], ["q", wrong])
    with pytest.raises(NameUnknownError, match="torque_limit"):
        simulate_batch([short], ["torque_limit"])


@needs_compiler
def test_without_a_compiler_they_run_one_by_one(
    fleet: list[Problem], alone: list[Run], monkeypatch: Any
) -> None:
    monkeypatch.setenv("PASSIFLEX_COMPILER", "none")
    monkeypatch.setattr(batch, "lane_loop", None)
    keep = ["q", "rotation", "tank_energy"]
    for ours, run in zip(simulate_batch(fleet[:3], keep), alone, strict=False):
        assert isinstance(ours, Recording)
        assert list(ours.signals) == keep
        assert same(ours, run)
        assert ours.has_tank == run.has_tank


# The arm of the studies


@pytest.fixture(scope="module")
def arms() -> list[Problem]:
    """Return eleven iiwas in Fig. 1's task, shortened; angles as fine as numbers are."""
    scenario = shipped_scenario("fig1_sampled")
    assert scenario.sensors is not None
    fine = scenario.sensors.model_copy(update={"link_resolution": 0.0, "motor_resolution": 0.0})
    step = scenario.reference[0].model_copy(update={"at": 0.3})
    push = scenario.forces[0].model_copy(update={"start": 0.6, "end": 0.8})
    parts = {"sensors": fine, "reference": (step,), "forces": (push,), "duration": 1.0}
    return varied(resolve(scenario.model_copy(update=parts)), 11)


@needs_compiler
def test_iiwas_in_lanes_are_iiwas_alone(arms: list[Problem]) -> None:
    runs = [simulate_unchecked(problem) for problem in arms]
    found = simulate_batch(arms, signals(runs[0]))
    for ours, run in zip(found, runs, strict=True):
        close(ours, run, 3.19 * 1.25)
    order = [10, 8, 6, 4, 2, 0, 1, 3, 5, 7, 9]
    again = simulate_batch([arms[i] for i in order], signals(runs[0]), threads=2)
    assert all_same(again, [found[i] for i in order])
    assert all_same(simulate_batch(arms[9:], signals(runs[0])), found[9:])


@needs_compiler
@pytest.mark.slow
def test_iiwas_do_not_depend_on_the_number_of_lanes(arms: list[Problem]) -> None:
    keep = ["q", "tau_m", "tank_energy", "measured_dq"]
    assert all_same(simulate_batch(arms, keep, width=4), simulate_batch(arms, keep, width=8))
