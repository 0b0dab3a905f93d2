"""The limit map: its borders are where the radius passes 1, and the nonlinear simulation says the same."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import passiflex
from passiflex.errors import ScenarioError, ValueRangeError
from passiflex.limits import LimitMap, check, limit_map
from passiflex.limits.confirmation import VISIBLE, Confirmation, confirm, disturbed, growth
from passiflex.limits.limit_map import DAMPING_SCALES, INERTIA_RATIOS, STIFFNESS_RATIOS, STIFFNESS_SCALES
from passiflex.limits.planes import Plane, least_inertias, scaled_impedance, stable_damping, within
from passiflex.limits.subject import sampled_problem, with_task
from passiflex.problems.altered import altered
from passiflex.problems.problem import SampledProblem
from passiflex.simulation import Problem, parse_scenario, resolve
from passiflex.stability import admissible as border
from passiflex.stability.admissible import shaping
from passiflex.stability.linear_loop import LinearLoop
from worlds import PLAIN, merged, world

HALF = 0.5e-3
MATCHED = {"inner_loop": "matched", "external_torque": "none"}


@lru_cache
def problem(delay: float = HALF, inner: str = "plain") -> Problem:
    own = MATCHED if inner == "matched" else {}
    return resolve(world(control=own | {"delay": delay}))


@lru_cache
def found() -> LimitMap:
    """Return the map of a loop that is half a period late."""
    return limit_map(problem())


# Borders


def test_the_grids_hold_the_points_that_people_ask_for() -> None:
    for grid, points in (
        (STIFFNESS_RATIOS, (0.5, 1, 2)),
        (STIFFNESS_SCALES, (1, 10)),
        (DAMPING_SCALES, (1,)),
    ):
        assert all(np.isclose(grid, p, rtol=1e-12).any() for p in points)


def test_a_plane_is_the_radius_over_the_gains() -> None:
    loop, shaped, impedance = LinearLoop(problem()), found().shaping, found().impedance
    assert shaped is not None
    assert shaped.radius.shape == (STIFFNESS_RATIOS.size, INERTIA_RATIOS.size)
    for i, j in ((0, 3), (6, 20), (12, 24)):
        gains = shaping(loop, shaped.horizontal[i], shaped.vertical[j])
        assert shaped.radius[i, j] == loop.radius(gains=gains)
        gains = scaled_impedance(loop, impedance.horizontal[i], impedance.vertical[j])
        assert impedance.radius[i, j] == loop.radius(gains=gains)


def test_the_least_inertia_is_a_border_at_every_stiffness_and_delay() -> None:
    least = found().least_inertia
    assert least is not None
    assert found().delays.tolist() == [0, 0.5, 1, 2]
    checked = 0
    for periods, borders in zip(found().delays, least, strict=True):
        loop = LinearLoop(altered(problem(), delay=periods * 1e-3))
        for ratio, value in zip(STIFFNESS_RATIOS, borders, strict=True):
            if within(value):
                on, beyond = (loop.radius(gains=shaping(loop, ratio, b)) for b in (value, 0.98 * value))
                assert on < 1 <= beyond
                checked += 1
            else:
                assert loop.radius(gains=shaping(loop, ratio, border.INERTIA_RATIOS[1])) >= 1
    assert checked > 25


def test_the_map_agrees_with_the_sentence() -> None:
    least, shaped, answer = found().least_inertia, found().shaping, found().admissible
    assert least is not None
    assert shaped is not None
    own, one = found().own_delay, int(np.argmin(np.abs(STIFFNESS_RATIOS - 1)))
    assert found().delays[own] == 0.5
    assert least[own, one] == pytest.approx(answer.least_inertia, rel=0.02)
    above = shaped.vertical > answer.least_inertia
    np.testing.assert_array_equal(shaped.radius[one] < 1, above)
    assert found().sentence == answer.sentence == check(problem()).sentence
    assert answer.borders == check(problem()).borders


def test_the_stable_damping_has_two_ends() -> None:
    loop, ends = LinearLoop(problem()), found().damping
    checked = 0
    for scale, least, most in zip(STIFFNESS_SCALES, *ends, strict=True):
        for value, beyond in ((least, 0.98), (most, 1.02)):
            if 0 < value < math.inf:
                radii = [loop.radius(gains=scaled_impedance(loop, scale, value * f)) for f in (1, beyond)]
                assert radii[0] < 1 <= radii[1]
                checked += 1
    assert checked > 12


def test_an_impedance_that_nothing_holds_has_no_stable_damping() -> None:
    """A plane with nothing stable, one with everything, and one with a gap: the longer stretch counts."""
    loop = LinearLoop(problem())
    values = np.geomspace(0.1, 10, 5)
    for inside, expected in (([0, 0, 0, 0, 0], (math.nan, math.nan)), ([1, 1, 1, 1, 1], (0, math.inf))):
        plane = Plane(np.ones(1), values, 1.5 - np.array([inside], dtype=float))
        np.testing.assert_equal(tuple(end.item() for end in stable_damping(loop, plane)), expected)
    gap = Plane(np.ones(1), values, 1.5 - np.array([[1, 0, 1, 1, 1]], dtype=float))
    least, most = stable_damping(loop, gap)
    assert values[1] <= least.item() <= values[2]
    assert most.item() == math.inf


def test_over_the_rate_the_delay_stays_as_many_periods() -> None:
    least = found().least_inertia_by_rate
    assert least is not None
    for d, i in ((1, 2), (3, 9)):
        periods, rate = found().delays[d], found().rates[i]
        there = altered(problem(), rate=rate, delay=periods / rate)
        assert least[d, i] == pytest.approx(least_inertias(LinearLoop(there), np.ones(1)).item(), rel=1e-6)
        assert found().radius_by_rate[d, i] == pytest.approx(LinearLoop(there).radius(), rel=1e-9)
    own = int(np.argmin(np.abs(found().rates - 1000)))
    assert least[found().own_delay, own] == pytest.approx(found().admissible.least_inertia, rel=0.02)


def test_a_matched_loop_predicts_over_each_delay_of_the_map() -> None:
    """If it went on to predict over its own, two periods would leave it unstable at K_e = K."""
    one = limit_map(problem(1e-3, "matched"))
    assert one.least_inertia is not None
    at_own_stiffness = one.least_inertia[:, int(np.argmin(np.abs(STIFFNESS_RATIOS - 1)))]
    assert (at_own_stiffness <= 0.01).all()
    untold = LinearLoop(problem(1e-3, "matched"))
    assert untold.radius(1e-3, 2e-3, shaping(untold, 1, 0.01)) > 1
    verdicts = [c.stable for c in one.confirmations]
    assert [c for c in one.confirmations if not c.agrees] == []
    assert {True, False} <= set(verdicts)


def test_without_confirmation_nothing_is_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    from passiflex.limits import confirmation

    monkeypatch.setattr(confirmation, "simulate_unchecked", lambda problem: pytest.fail("simulated"))
    assert limit_map(problem(), confirmed=False).confirmations == ()


# Confirmation


def test_theory_and_simulation_say_the_same_on_both_sides_of_every_border() -> None:
    points = found().confirmations
    assert [c for c in points if not c.agrees] == []
    for plane in ("shaping", "impedance", "rate"):
        sides = [c.stable for c in points if c.plane == plane]
        assert sides.count(True) >= 2
        assert sides.count(False) >= 2
    assert points[0][:3] == ("impedance", 1.0, 1.0)


def test_a_confirmed_rate_keeps_as_many_periods_of_delay() -> None:
    point = confirm(problem(), "rate", (2000.0, 0.3), rate=2000.0)
    assert point.radius == LinearLoop(altered(problem(), rate=2000.0, delay=HALF / 2)).radius()


def test_a_motion_that_is_flung_to_where_it_settles_has_grown() -> None:
    """D_x of 12 times the scenario's flings the arm far away, where it comes to rest."""
    p = problem()
    loop = LinearLoop(p)
    flung = altered(p, gains=scaled_impedance(loop, 1, 1.1 * found().damping.most[4]))
    assert LinearLoop(flung).radius() > VISIBLE
    assert growth(disturbed(flung)) > 10


def test_a_run_that_leaves_the_finite_numbers_has_grown_without_bound() -> None:
    p = problem()
    assert growth(disturbed(altered(p, gains=shaping(LinearLoop(p), 16, 0.01)))) == math.inf


def test_growth_is_that_of_the_linear_mode() -> None:
    """Beyond the border by little: r per period, over a third of the run."""
    p, loop = problem(), LinearLoop(problem())
    least = found().admissible.least_inertia
    gains = shaping(loop, 1, 0.998 * least)
    radius = loop.radius(gains=gains)
    assert 1 < radius < 1.0011
    assert growth(disturbed(altered(p, gains=gains))) == pytest.approx(radius ** (2000 / 3), rel=0.05)


def test_nothing_that_hides_a_growing_motion_is_left() -> None:
    motors = {"torque_limit": "robot", "torque_rate_limit": 500.0, "coulomb_friction": 2.0}
    rough = resolve(
        world(
            control={"delay": HALF, "jitter": 1e-4, "missed": 0.1},
            sensors={"link_resolution": 1e-3, "motor_resolution": 1e-4},
            motors=motors,
            noise={"torque_variance": 0.2, "hold": 1e-3},
            drags=[{"from": 0, "to": 1, "viscous": 10}],
            tank={"initial": 0.5, "cap": 1.0, "power": 0.1},
            output_interval=2e-3,
        )
    )
    ours, plain = (growth(disturbed(p)) for p in (rough, problem()))
    assert ours == pytest.approx(plain, rel=1e-6)
    with pytest.raises(ValueRangeError, match="no control rate"):
        disturbed(resolve(world(control=None, tank=None)))


def test_a_point_says_what_theory_and_simulation_say() -> None:
    point = Confirmation("shaping", 1.0, 0.1, 1.01, 0.5)
    assert (point.stable, point.settles, point.agrees) == (False, True, False)
    assert Confirmation("shaping", 1.0, 0.1, 0.99, 0.5).agrees


# What it can be asked about


def test_a_scenario_its_file_and_its_problem_are_one(tmp_path: Path) -> None:
    path = tmp_path / "planar.yaml"
    path.write_text(PLAIN.replace("rate: 1000", "rate: 1000, delay: 0.5 ms"))
    scenario = world(control={"delay": HALF})
    answers = {check(subject).sentence for subject in (scenario, path, str(path), problem())}
    assert len(answers) == 1
    assert passiflex.check is check
    assert passiflex.limit_map is limit_map


@pytest.mark.parametrize(("rate", "delay"), [(500.0, 2e-3), ("0.5 kHz", "2 ms"), ("500 1/s", 0.002)])
def test_rate_and_delay_may_have_units(rate: float | str, delay: float | str) -> None:
    answer = check(problem(), rate, delay)
    assert (answer.rate, answer.delay) == (500, 2e-3)


def continuous() -> dict[str, Any]:
    return {k: v for k, v in yaml.safe_load(PLAIN).items() if k not in ("control", "tank")}


def test_what_runs_in_continuous_time_needs_a_rate() -> None:
    plain = resolve(world(control=None, tank=None))
    with pytest.raises(ValueRangeError, match=r"no control rate.*try --rate '1 kHz', or rate=1000"):
        limit_map(plain)
    sampled = sampled_problem(plain, "2 kHz")
    assert isinstance(sampled, SampledProblem)
    assert (sampled.period, sampled.delay) == (5e-4, 0)
    assert sampled.law.robot is plain.law.robot
    assert check(world(control=None, tank=None), 2000.0).rate == 2000


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"rate": 0}, "rate; got 0; needs Hz, one number, > 0"),
        ({"rate": "1 m"}, "rate; got '1 m'"),
        ({"rate": "fast"}, "rate; got 'fast'.*try text with its unit, as '1 kHz'"),
        ({"rate": 2e6}, "rate; got 2000000.0"),
        ({"delay": -1}, "delay; got -1; needs s, one number, ≥ 0"),
        ({"delay": float("nan")}, "delay; got nan"),
        ({"delay": 1.0}, "delay of a command; got 1 s; needs 0 to 60 periods"),
    ],
)
def test_a_rate_or_delay_that_makes_no_sense_is_refused(told: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueRangeError, match=message):
        check(problem(), **told)


def test_mistakes_in_a_file_are_told() -> None:
    with pytest.raises(ScenarioError):
        check("none.yaml")


# Another task, another inner loop


POSE = {
    "robot": "iiwa14",
    "posture": [0.0, 0.5, 0.0, -1.2, 0.0, 0.6, 0.0],
    "law": {
        "task": "pose",
        "stiffness": {"translation": 300, "rotation": 20},
        "damping": {"matrix": np.diag([60.0, 50, 40, 3, 2, 1])},
        "shaped_stiffness": {"ratio": 1},
    },
    "control": {"fallback": {"stiffness": {"translation": 100, "rotation": 10}}},
    "gains": [{"at": 0.2, "duration": 0.1, "stiffness": {"translation": 200, "rotation": 10}}],
    "reference": [{"at": 0.1, "kind": "step", "by": [0, 0, 0.05], "turn": [0, 0, 0.1]}],
}


def test_a_pose_becomes_a_position_that_keeps_what_it_has_of_translation() -> None:
    position = {
        "law": {
            "task": "position",
            "stiffness": {"rotation": None},
            "damping": {"matrix": np.diag([60.0, 50, 40])},
        },
        "control": {"fallback": {"stiffness": {"rotation": None}}},
        "gains": [{"at": 0.2, "duration": 0.1, "stiffness": {"translation": 200}}],
        "reference": [{"at": 0.1, "kind": "step", "by": [0, 0, 0.05]}],
    }
    data = merged(merged(yaml.safe_load(PLAIN), {"law": {"damping": {"translation": None}}}), POSE)
    scenario, written = (parse_scenario(yaml.safe_dump(d)) for d in (data, merged(data, position)))
    assert with_task(scenario, "position").to_yaml() == written.to_yaml()
    assert with_task(scenario, "pose").to_yaml() == scenario.to_yaml()
    with pytest.raises(ScenarioError, match=r"law\.stiffness\.rotation: missing; a pose task needs it"):
        with_task(written, "pose")


def test_a_problem_takes_another_inner_loop_as_its_scenario_does() -> None:
    loops = [sampled_problem(s, inner_loop="matched") for s in (problem(), world(control={"delay": HALF}))]
    written = resolve(world(control={"delay": HALF, "inner_loop": "matched"}))
    for loop in loops:
        assert loop.text.replace(", changed in memory", "") == written.text
        assert check(loop).spectrum.radius == check(written).spectrum.radius
    assert check(problem()).spectrum.radius != check(written).spectrum.radius
