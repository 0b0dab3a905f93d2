"""Surfaces: energy to the last bit, and arms that press on them."""

from __future__ import annotations

import math
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import passiflex as pf
from honest import balance, require_honest
from passiflex.control.motion import Pose
from passiflex.control.posture import posture
from passiflex.elements import (
    AbstractNormal,
    AbstractShape,
    Box,
    Cylinder,
    HuntCrossley,
    Linear,
    Mobility,
    Plane,
    Sphere,
    Surface,
)
from passiflex.errors import PassiflexError
from passiflex.passivity import audit, environment_balance
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import Run, parse_scenario
from worlds import world

SHAPES = (Plane(), Sphere(), Cylinder(), Box())


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("normal", [Linear(), HuntCrossley()], ids=["linear", "hunt_crossley"])
@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_a_surface_gives_nothing_of_its_own(
    shape: AbstractShape, normal: AbstractNormal, *, rubs: bool, moved: bool
) -> None:
    """Also at edges, within and without, with points anywhere on the hand, and with what moves it in the books."""
    surface = Surface(shape=shape, normal=normal, points=2, rubs=rubs, moved=moved)
    require_honest(surface)
    assert any(balance(surface, seed)[1] > 0 for seed in range(50))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_the_way_out_is_where_the_distance_grows(shape: AbstractShape) -> None:
    """|∇distance| = 1, along the direction that is said: in, out, beside faces, edges and corners."""
    p = cs.SX.sym("p", 3)
    nearest = shape.nearest(p, {name: cs.SX(0.7) for name in shape.sizes})
    f = cs.Function("f", [p], [cs.gradient(nearest.distance, p), nearest.outward])
    rng = np.random.default_rng(3)
    for _ in range(300):
        slope, outward = (np.array(v).ravel() for v in f(rng.normal(size=3)))
        np.testing.assert_allclose(outward, slope, atol=1e-9)
        assert np.linalg.norm(outward) == pytest.approx(1, abs=1e-9)


PLANE = {"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1], "stiffness": 1e4}
"""Under the planar arm, which moves in x and z."""


def beside(**more: Any) -> dict[str, Any]:
    """Return a wall 20 mm above the hand's start, facing down."""
    return PLANE | {"point": [0, 0, 0.02], "normal": [0, 0, -2], "relative": True} | more


def pressed(*surfaces: dict[str, Any], **changes: Any) -> Run:
    run = pf.simulate(
        world(**{"environment": list(surfaces), "duration": 1.0, "output_interval": 0.002} | changes)
    )
    assert not run.failure
    return run


@pytest.mark.parametrize("stiffness", [1e3, 1e4, 1e5, 1e6])
def test_an_arm_presses_with_its_own_spring(stiffness: float) -> None:
    """Springs in a row share the 30 mm by which the goal is in the wall: of law, joints and wall."""
    scenario = world(environment=[beside(stiffness=stiffness, dissipation=1.0)], duration=4.0)
    run, robot = pf.simulate(scenario), FlexibleJointRobot.load(scenario.robot)
    J = posture(robot, run["q"][-1], robot.nominal()).jacobian[2]
    softness = 1 / 200 + 1 / stiffness + J @ (J / robot.joint_stiffness)
    depth, force = run["plane_depth"][-1], run["plane_force"][-1]
    assert force[2] == pytest.approx(-0.03 / softness, rel=1e-3)
    assert depth == pytest.approx(-force[2] / stiffness, rel=1e-6)
    assert audit(run).verdict == "passive"
    assert environment_balance(run).worst < 1e-4
    assert audit(run).ledger_residual < 1e-4


def test_the_books_close_better_with_shorter_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kink where the hand arrives is of a fixed order, no more."""
    left = []
    for share in (0.3, 0.03):
        monkeypatch.setattr("passiflex.simulation.simulate_sampled.TOUCHING", share)
        run = pressed(beside(stiffness=1e6, dissipation=1.0))
        left.append(environment_balance(run).worst)
    assert left[1] < left[0] / 3


def test_what_moves_a_wall_gives_the_energy() -> None:
    """A wall that comes to a hand at rest pushes it; all that it gave, stored and lost came from what moves it."""
    coming = beside(
        point=[0, 0, -0.02],
        normal=[0, 0, 1],
        motion=[{"kind": "move", "at": 0.1, "by": [0, 0, 0.06], "duration": 0.3}],
    )
    run = pressed(coming, reference=[], tank={"initial": 2})
    assert run["plane_place"][-1, 2] - run["plane_place"][0, 2] == pytest.approx(0.06)
    assert run["position"][-1, 2] - run["position"][0, 2] > 0.03
    assert run["plane_supplied_energy"][-1] > 0.1
    assert environment_balance(run).worst < 1e-4 * run["plane_supplied_energy"].max()
    assert audit(run).verdict == "passive"


def test_surfaces_have_names_and_books_of_their_own() -> None:
    run = pressed(beside(), beside(point=[0, 0, -0.5], normal=[0, 0, 1]), beside(name="lid", stiffness=2e4))
    assert [e.name for e in run.elements] == ["friction", "plane", "plane_2", "lid"]
    assert not run["plane_2_force"].any()
    np.testing.assert_allclose(run["lid_force"][-1], 2 * run["plane_force"][-1], rtol=1e-3)


def test_a_wall_that_is_turned_with_the_arm_is_the_same_wall() -> None:
    """Each shape, where its nearest point is that of the plane, presses as the plane does: a large one bends little."""
    flat = pressed(beside())["position"]
    ways = (
        {"kind": "box", "centre": [0, 0, 0.12], "size": [1, 1, 0.2]},
        {"kind": "sphere", "centre": [0, 0, 1000.02], "radius": 1000},
        {"kind": "cylinder", "centre": [0, 0, 1000.02], "axis": [0, 1, 0], "radius": 1000},
        {"kind": "cylinder", "centre": [0, 0, 0.12], "axis": [0, 0, 3], "radius": 1, "length": 0.2},
    )
    for way in ways:
        body = {k: v for k, v in beside().items() if k not in ("point", "normal")} | way
        np.testing.assert_allclose(pressed(body)["position"], flat, atol=1e-6)


def test_a_hand_of_several_points_is_pressed_at_those_that_touch() -> None:
    one = pressed(beside(), hand={"radius": 0.01})
    two = pressed(beside(), hand={"radius": 0.01, "points": [[0, 0, 0], [0, 0.3, 0]]})
    assert abs(one["plane_force"][-1, 2]) > 1
    np.testing.assert_allclose(two["plane_force"][-1, 2], one["plane_force"][-1, 2], rtol=0.02)


@pytest.mark.parametrize(
    "hard",
    [
        {"viscous": 3e4},
        {"viscous": 3e4, "friction": 0.5},
        {"law": "linear", "damping": 5e3},
        {"stiffness": 1e7, "friction": 0.5, "bristle_stiffness": 1e7},
    ],
    ids=["viscous", "viscous and dry", "damped", "stiff"],
)
def test_what_is_fast_in_a_surface_is_resolved(hard: dict[str, Any]) -> None:
    """Its damper, its viscous friction and its bristles as well as its spring; at points far from the end effector."""
    far = {"points": [[0, 0, 0], [-0.3, 0.3, 0]], "radius": 0.005}
    for hand in ({"radius": 0.01}, far):
        tilted = beside(normal=[0.3, 0, -2], **hard)
        run = pressed(
            tilted, hand=hand, reference=[{"at": 0.1, "kind": "move", "by": [0.05, 0, 0.05], "duration": 0.3}]
        )
        assert np.abs(run["plane_force"]).max() > 1
        assert environment_balance(run).worst < 2e-3 * np.abs(run["plane_given_energy"]).max()
        assert audit(run).verdict == "passive"


def test_a_point_far_from_the_end_effector_is_moved_as_a_lever_says() -> None:
    """Of a body that turns about the end effector alone: r²/I."""
    free = Mobility(
        np.diag([0, 0, 0, 0, 0, 2.0]), Rotation.from_rotvec([0, 0, 1.0]).as_matrix(), np.zeros(1), np.zeros(1)
    )
    assert free.at([0.3, 0.4, 0.7]) == pytest.approx(2 * 0.25)
    assert free.at([0, 0, 1]) == pytest.approx(0)


MISTAKES = {
    "within": (
        beside(point=[0, 0, -0.01]),
        r"the hand starts within plane; got 10 mm deep, with the end effector at .*; needs a start outside; .*; "
        r"try a place 10 mm or more along \[0, 0, 1\]",
    ),
    "swallowed": (
        {"kind": "sphere", "name": "planet", "centre": [0, 0, 0], "radius": 50, "stiffness": 100},
        "the hand starts within planet",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_start_within_a_surface_is_refused(case: str) -> None:
    surface, said = MISTAKES[case]
    with pytest.raises(PassiflexError, match=said):
        pressed(surface)


REFUSED = {
    "soft": ({"stiffness": 0}, "stiffness"),
    "flat": ({"normal": [0, 0, 0]}, "normal: is no direction"),
    "damper": ({"damping": 3}, r"damping: is of law: linear; this one is hunt_crossley"),
    "dissipation": (
        {"law": "linear", "dissipation": 3},
        "dissipation: is of law: hunt_crossley; this one is linear",
    ),
    "turning": (
        {"motion": [{"kind": "step", "at": 0.1, "by": [0, 0, 0], "turn": [0, 0, 1]}]},
        "turn: a surface moves, and does not turn",
    ),
    "disorder": (
        {"motion": [{"kind": "hold", "at": 0.2}, {"kind": "hold", "at": 0.1}]},
        r"motion\[1\]\.at: later than the one before; got 0.1 s",
    ),
    "name": ({"name": "A wall"}, "name"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_surface_that_is_none_is_refused(case: str) -> None:
    changes, said = REFUSED[case]
    with pytest.raises(PassiflexError, match=said):
        world(environment=[beside(**changes)])


def test_two_of_one_name_are_refused() -> None:
    with pytest.raises(PassiflexError, match="another entry has the name lid"):
        world(environment=[beside(name="lid"), beside(name="lid")])


def test_a_scenario_with_surfaces_is_written_whole() -> None:
    scenario = world(
        environment=[beside(friction=0.2, motion=[{"kind": "hold", "at": 0.2}])], hand={"radius": 0.01}
    )
    assert parse_scenario(scenario.to_yaml()) == scenario


def test_continuous_time_touches_too() -> None:
    """And the sampled run comes nearer to it, the faster its clock."""
    surface = beside(dissipation=1.0)
    slow = pressed(surface, control=None, tank=None, noise=None)
    assert abs(slow["plane_force"][-1, 2]) > 1
    assert environment_balance(slow).worst < 1e-6
    far = [
        np.abs(pressed(surface, tank=None, control={"rate": rate})["q"] - slow["q"]).max()
        for rate in (4000, 16000)
    ]
    assert far[1] < far[0] / 3


def test_the_start_is_looked_at_where_the_hand_is() -> None:
    """With the hand turned, and a point away from the end effector."""
    point = Pose(np.array([1.0, 2.0, 3.0]), Rotation.from_rotvec([0, math.pi / 2, 0]).as_matrix())
    surface = Surface(values={"points": np.array([[0.5, 0, 0]]), "place": [0, 0, 2.6], "roundness": 0.0})
    with pytest.raises(PassiflexError, match="100 mm deep"):
        surface.require_apart(point)
    surface.require_apart(point._replace(position=np.array([1.0, 2.0, 3.2])))
