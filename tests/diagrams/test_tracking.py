"""Where the end effector is and should be: curves of the run, the angle between two orientations, the ideal."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from diagrams.seen import (
    CONTROL,
    DRAG,
    PUSHED,
    RIGID,
    altered,
    continuous,
    held_back,
    made_up,
    rigid,
    simulated,
    without,
)
from passiflex.control.gain_design import target_inertia
from passiflex.diagrams import Panel, Viewed, ideal_motion, panels, roles_of, viewed
from passiflex.diagrams.tracking import orientation_error
from passiflex.metrics.measures import _ideal
from passiflex.simulation import Run, parse_scenario, resolve


def shown(one: Viewed, others: tuple[Viewed, ...] = ()) -> dict[str, Panel]:
    return {p.choice: p for p in panels("tracking", one, others)}


def by_role(panel: Panel) -> dict[str, np.ndarray]:
    return {curve.role: curve.values for curve in panel.curves}


def test_positions_are_seen_from_where_the_end_effector_was_at_the_start() -> None:
    run = held_back()
    ideal = np.arange(3.0 * run.time.size).reshape(-1, 3)
    found = shown(Viewed(run, "it", ideal))
    for i, axis in enumerate("xyz"):
        curves = by_role(found[axis])
        start = run["position"][0, i]
        np.testing.assert_array_equal(curves["proposed"], run["position"][:, i] - start)
        np.testing.assert_array_equal(curves["reference"], run["desired_position"][:, i] - start)
        np.testing.assert_array_equal(curves["governed"], run["governed_position"][:, i] - start)
        np.testing.assert_array_equal(curves["msd"], ideal[:, i])
        assert (found[axis].title, found[axis].unit) == (f"{axis.upper()} displacement", "m")
        assert [c.label for c in found[axis].curves] == [
            "reference x_d",
            "reference in force",
            "it",
            "ideal MSD, ζ = 0.7",
        ]


def test_the_distance_is_that_to_the_reference_also_of_the_ideal() -> None:
    run, ideal = continuous(), ideal_motion(continuous())
    assert ideal is not None
    curves = by_role(shown(Viewed(run, "it", ideal))["distance"])
    away = run["position"] - run["desired_position"]
    np.testing.assert_allclose(curves["proposed"] ** 2, (away**2).sum(axis=1), rtol=1e-12)
    wished = run["desired_position"] - run["desired_position"][0]
    np.testing.assert_allclose(curves["msd"] ** 2, ((ideal - wished) ** 2).sum(axis=1), rtol=1e-9, atol=1e-20)


def test_a_reference_that_was_never_held_back_stands_for_both() -> None:
    run = made_up(governed_position=made_up()["desired_position"])
    assert "governed" not in by_role(shown(Viewed(run, "it"))["x"])
    assert "governed" in by_role(shown(Viewed(made_up(), "it"))["x"])


def test_a_position_task_has_no_orientation_to_follow() -> None:
    assert list(shown(Viewed(continuous(), "it"))) == ["x", "y", "z", "distance"]
    assert list(shown(Viewed(made_up(), "it"))) == ["x", "y", "z", "distance", "orientation"]


@given(st.floats(0, np.pi), st.integers(0, 2**32 - 1))
def test_the_angle_between_two_orientations(angle: float, seed: int) -> None:
    """Against SciPy's quaternions, at any orientation; from 1e-12 rad to half a turn."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    base = Rotation.random(random_state=rng)
    turned = base * Rotation.from_rotvec(angle * axis)
    (found,) = orientation_error(base.as_matrix()[None], turned.as_matrix()[None])
    assert found == pytest.approx(angle, abs=2e-15 + 1e-14 * angle)


@pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_small_angle_keeps_its_digits(angle: float) -> None:
    """The cosine alone gives 0 from 1e-8 rad on."""
    turned = Rotation.from_rotvec([0, angle, 0]).as_matrix()
    assert orientation_error(np.eye(3)[None], turned[None])[0] == pytest.approx(angle, rel=1e-12)


def test_each_compared_run_has_its_own_look_and_its_own_time() -> None:
    others = (Viewed(rigid(), "rigid"), Viewed(held_back(), "second"), Viewed(rigid(), "third"))
    one = Viewed(continuous(), "first")
    assert roles_of(one, others) == ("proposed", "baseline", "other 1", "other 2")
    found = shown(one, others)
    assert set(found) == {"x", "y", "z", "distance"}
    for panel in found.values():
        compared = {c.label: c for c in panel.curves if c.label in ("rigid", "second", "third")}
        assert set(compared) == {"rigid", "second", "third"}
        np.testing.assert_array_equal(compared["second"].time, held_back().time)


def test_looks_begin_again_after_the_last() -> None:
    runs = [Viewed(continuous(), str(k)) for k in range(7)]
    assert roles_of(runs[0], runs[1:])[-2:] == ("other 1", "other 2")


def test_runs_go_by_their_names_and_the_first_has_its_ideal() -> None:
    first, second, third = viewed([continuous(), continuous(), rigid()])
    assert [v.label for v in (first, second, third)] == ["pushed (1)", "pushed (2)", "pushed (3)"]
    assert first.ideal is not None
    assert second.ideal is None
    assert viewed([altered(rigid(), name="other")])[0].label == "other"


def test_gaps_and_missing_signals() -> None:
    run = altered(made_up())
    run.data["position"][3, 0] = np.nan
    found = shown(Viewed(run, "it"))
    assert np.flatnonzero(np.isnan(by_role(found["x"])["proposed"])).tolist() == [3]
    assert np.isfinite(by_role(found["y"])["proposed"]).all()
    assert np.flatnonzero(np.isnan(by_role(found["distance"])["proposed"])).tolist() == [3]
    bare = without(run, "desired_position", "governed_position", "rotation")
    assert list(by_role(shown(Viewed(bare, "it"))["z"])) == ["proposed"]
    assert list(shown(Viewed(bare, "it"))) == ["x", "y", "z"]


def test_a_start_that_is_lost_is_taken_from_the_first_row_that_is_there() -> None:
    run = altered(made_up())
    run.data["position"][:2] = np.nan
    moved = by_role(shown(Viewed(run, "it"))["x"])["proposed"]
    np.testing.assert_array_equal(moved[2:], run["position"][2:, 0] - run["position"][2, 0])


@pytest.mark.parametrize("law", [PUSHED["law"], RIGID, PUSHED["law"] | {"damping": {"ratio": 0.7}}])
def test_the_ideal_is_that_of_the_campaigns(law: dict[str, object]) -> None:
    """Also where the damping is a ratio, and has to be taken from the robot."""
    run = simulated(law=law)
    problem = resolve(parse_scenario(yaml.safe_dump(PUSHED | {"law": law})))
    found = ideal_motion(run)
    assert found is not None
    np.testing.assert_allclose(found, _ideal(problem, run.time.size), rtol=0, atol=1e-12)


def test_the_ideal_stands_at_the_rows_of_a_thinned_or_broken_file() -> None:
    whole = ideal_motion(continuous())
    assert whole is not None
    rows = [0, 3, 4, 17, 50]
    part = ideal_motion(Run(continuous().data.isel(time=rows)))
    assert part is not None
    np.testing.assert_allclose(part, whole[rows], rtol=0, atol=1e-12)


def test_the_ideal_of_one_axis_is_the_closed_form() -> None:
    """m ẍ + d ẋ + k x = k x_d with ζ = 0.7: 1 − e^(−ζωs) (cos ω_d s + ζω/ω_d sin ω_d s) of a step."""
    run = simulated(reference=PUSHED["reference"][:1], forces=[])
    found = ideal_motion(run)
    assert found is not None
    m = float(target_inertia(np.array([[60.0]]), np.array([[20.0]]), 0.7)[0, 0])
    w = np.sqrt(60 / m)
    decay, w_d, s = 0.7 * w, w * np.sqrt(1 - 0.49), np.maximum(run.time - 0.2, 0)
    expected = 0.05 * (1 - np.exp(-decay * s) * (np.cos(w_d * s) + decay / w_d * np.sin(w_d * s)))
    np.testing.assert_allclose(found[:, 2], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "changes",
    [
        {"drags": DRAG},
        {"feedforward": [{"from": 0.1, "to": 0.2, "force": [0, 0, 1]}]},
        {"gains": [{"at": 0.3, "duration": 0.1, "stiffness": {"translation": 80}}]},
        {"reference": {"rows": "t,kx,ky,kz\n0.3,80,80,80\n"}},
        {"reference": {"rows": "t,dx,dy,dz\n0.3,10,10,10\n"}},
        {"law": PUSHED["law"] | {"stiffness": {"translation": [60, 30, 60], "axes": "tool"}}},
        {"law": PUSHED["law"] | {"damping": {"translation": [20, 10, 20], "axes": "tool"}}},
        {"environment": [{"kind": "plane", "point": [0, 0, -1], "normal": [0, 0, 1], "stiffness": 1e4}]},
        {"environment": [{"kind": "load", "from": 0.2, "to": 0.4, "mass": 0.5}]},
        {"environment": [{"kind": "person", "from": 0.2, "to": 0.4}]},
        {"environment": [{"kind": "end_stops"}]},
    ],
)
def test_there_is_no_ideal_where_something_acts_that_it_does_not_know(changes: dict[str, object]) -> None:
    scenario = PUSHED | {"control": CONTROL} | changes
    run = altered(continuous(), scenario=yaml.safe_dump(scenario))
    assert run.scenario is not None
    assert ideal_motion(run) is None
    known = altered(continuous(), scenario=yaml.safe_dump(PUSHED | {"control": CONTROL}))
    assert ideal_motion(known) is not None


def test_there_is_no_ideal_without_configuration_or_without_the_robot_that_it_needs() -> None:
    assert ideal_motion(made_up()) is None
    nameless = altered(continuous())
    del nameless.data.attrs["scenario"]
    assert ideal_motion(nameless) is None
    elsewhere = PUSHED | {"robot": "gone.yaml"}
    assert ideal_motion(altered(continuous(), scenario=yaml.safe_dump(elsewhere))) is not None
    ratio = elsewhere | {"law": PUSHED["law"] | {"damping": {"ratio": 0.7}}}
    assert ideal_motion(altered(continuous(), scenario=yaml.safe_dump(ratio))) is not None
    older = altered(continuous(), scenario=yaml.safe_dump(ratio))
    del older.data.attrs["joint_parameters"]
    assert ideal_motion(older) is None
