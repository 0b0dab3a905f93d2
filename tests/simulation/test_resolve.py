"""From a scenario to numbers: what is refused, and what a good scenario becomes."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from passiflex.control.gain_design import target_inertia
from passiflex.control.law import ImpedanceLaw
from passiflex.control.motion import pose_at
from passiflex.control.posture import posture
from passiflex.control.rigid import RigidImpedanceLaw
from passiflex.control.tank import NO_CAP
from passiflex.errors import NameUnknownError, PassiflexError, ScenarioError, SizeError, ValueRangeError
from passiflex.problems.natural_inertia import natural_inertia
from passiflex.robots import FlexibleJointRobot
from passiflex.simulation import ClosedLoop, Problem, Scenario, parse_scenario, resolve
from passiflex.studies import shipped_scenario

POSTURE = [0, 0.6, 0, -1.2, 0, 1.0, 0]
LAW = {
    "type": "impedance",
    "task": "pose",
    "gravity": "robot",
    "shaped_stiffness": {"ratio": 10},
    "shaped_inertia": {"ratio": 0.01},
    "stiffness": {"translation": 60, "rotation": 40},
    "damping": {"translation": 20, "rotation": 10},
}
RIGID = {
    "type": "rigid",
    "task": "pose",
    "gravity": "robot",
    "stiffness": LAW["stiffness"],
    "damping": LAW["damping"],
    "target_inertia": {"damping_ratio": 0.7},
}


RIGID_JOINTS = {"joint_stiffness": 1e3}


def problem(
    law: dict[str, Any] | None = None,
    robot: FlexibleJointRobot | None = None,
    robot_name: str = "iiwa14",
    **changes: Any,
) -> Problem:
    """Resolve a small scenario; `law` completes the impedance law, or is a rigid one."""
    law = law or {}
    data = {
        "name": "test",
        "robot": robot_name,
        "posture": POSTURE,
        "law": law if law.get("type") == "rigid" else LAW | law,
        "duration": 10,
    } | changes
    return resolve(parse_scenario(yaml.safe_dump(data)), robot)


def plant(p: Problem) -> dict[str, np.ndarray]:
    return p.law.robot.layout.unpack(p.plant)


def model(p: Problem) -> dict[str, np.ndarray]:
    return p.law.robot.layout.unpack(p.model)


def gains(p: Problem) -> dict[str, np.ndarray]:
    return p.law.layout.unpack(p.gains)


def refused(kind: type[PassiflexError], **changes: Any) -> str:
    with pytest.raises(kind) as error:
        problem(**changes)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_posture_of_the_wrong_size() -> None:
    message = refused(SizeError, posture=[0.1, 0.2])
    assert message == "posture does not fit robot 'iiwa14'; got 2 angles; needs 7 angles in rad"


def test_a_posture_in_degrees_is_recognised() -> None:
    message = refused(ValueRangeError, posture=[0, 30, 0, -60, 0, 50, 0])
    assert message == (
        "posture: joint 2 of 'iiwa14' is outside its limits; got 30 rad; needs -2.094 to 2.094 rad; "
        "try degrees written with their unit, as '30 deg'"
    )


def test_a_posture_just_outside_its_limits() -> None:
    message = refused(ValueRangeError, posture=[0, 0.6, 0, -2.2, 0, 1, 0])
    assert message == (
        "posture: joint 4 of 'iiwa14' is outside its limits; got -2.2 rad; needs -2.094 to 2.094 rad"
    )


def test_a_posture_at_its_limit_is_inside() -> None:
    limit = float(FlexibleJointRobot.load("iiwa14").position_limit[5, 1])
    assert problem(posture=[0, 0.6, 0, -1.2, 0, limit, 0]).q[5] == limit


STRAIGHT = [0.0] * 7


@pytest.mark.parametrize("regularisation", [0, 1e-9])
def test_a_singular_posture_without_regularisation(regularisation: float) -> None:
    """To start where J is singular, ε must not be a guard of round-off only, as the default is not."""
    message = refused(ValueRangeError, posture=STRAIGHT, law={"regularisation": regularisation})
    assert message.startswith("posture is singular for task 'pose'; got smallest singular value of J ")
    assert message.endswith("try another posture, task: position, or regularisation of 1e-06 1/kg or more")


@pytest.mark.parametrize("more", [{"regularisation": 1e-3}, {}])
def test_a_singular_posture_with_regularisation(more: dict[str, float]) -> None:
    """ε > 0 bounds Λ there, and with it the damping that a ratio asks for."""
    p = problem(posture=STRAIGHT, law={"damping": {"ratio": 0.7}} | more)
    assert np.isfinite(p.gains).all()
    assert np.linalg.eigvalsh(gains(p)["damping"]).min() > 0


@pytest.mark.parametrize("regularisation", [0, 1e-3])
def test_a_singular_posture_with_the_rigid_law(regularisation: float) -> None:
    """It divides by J M⁻¹ Jᵀ: no regularisation makes that a law."""
    message = refused(ValueRangeError, posture=STRAIGHT, law=RIGID | {"regularisation": regularisation})
    assert message.startswith("posture is singular for task 'pose'")
    assert "got smallest singular value of J " in message
    assert "another posture" in message


def test_the_rigid_law_needs_as_many_joints_as_directions() -> None:
    law = {
        "type": "rigid",
        "task": "position",
        "stiffness": {"translation": 60},
        "damping": {"translation": 20},
        "target_inertia": {"translation": 3},
    }
    message = refused(ValueRangeError, **{"robot_name": "planar2r", "posture": [0.5, 0.8], "law": law})
    assert "posture is singular for task 'position'" in message
    assert "got 2 joints" in message


def test_an_unknown_robot_lists_the_nearest() -> None:
    message = refused(NameUnknownError, robot_name="iiwa15")
    assert message.startswith("unknown robot; got 'iiwa15'; needs one of fr3, gen3, iiwa14, ")
    assert message.endswith("; try 'iiwa14' or 'iiwa7' or 'iiwa14_stuerz'")


@pytest.mark.parametrize("name", ["shaped_stiffness", "shaped_inertia"])
def test_shaping_of_the_wrong_size(name: str) -> None:
    message = refused(SizeError, law={name: [1.0, 2.0]})
    assert message == f"law.{name} does not fit robot 'iiwa14'; got 2 numbers; needs one number or 7"


def test_shaping_by_numbers() -> None:
    each = [1e4, 2e4, 3e4, 4e4, 5e4, 6e4, 7e4]
    g = gains(problem(law={"shaped_stiffness": each, "shaped_inertia": "0.1 kg m^2"}))
    np.testing.assert_array_equal(g["shaped_stiffness"], each)
    np.testing.assert_array_equal(g["shaped_inertia"], np.full(7, 0.1))


def test_gains_are_those_of_the_scenario() -> None:
    p = problem(law={"null_space_damping": 5, "regularisation": 1e-6})
    g = gains(p)
    assert isinstance(p.law, ImpedanceLaw)
    np.testing.assert_array_equal(g["stiffness"], np.diag([60.0] * 3 + [40.0] * 3))
    np.testing.assert_array_equal(g["damping"], np.diag([20.0] * 3 + [10.0] * 3))
    np.testing.assert_array_equal(g["shaped_stiffness"], 10 * p.law.robot.joint_stiffness)
    np.testing.assert_array_equal(g["shaped_inertia"], 0.01 * p.law.robot.motor_inertia)
    assert (g["null_space_damping"], g["regularisation"]) == (5, 1e-6)


def moving_inertia(p: Problem) -> np.ndarray:
    """Return (J (M + B_e)⁻¹ Jᵀ)⁻¹ at the start."""
    at = posture(p.law.robot, p.q, plant(p))
    moving = at.mass_matrix + np.diag(gains(p)["shaped_inertia"])
    return np.linalg.inv(at.jacobian @ np.linalg.solve(moving, at.jacobian.T))


@pytest.mark.parametrize("ratio", [0.3, 0.7, 1.0])
def test_damping_by_ratio_damps_every_mode_alike(ratio: float) -> None:
    """All poles of Λ ẍ + D_x ẋ + K_x x = 0 at the start posture have −Re λ / |λ| = ζ; 2 √K has not.

    Λ is that of links and shaped motors, (J (M + B_e)⁻¹ Jᵀ)⁻¹. The law believes in joints that are a thousand
    times as stiff: of elastic ones see test_damping_by_ratio.
    At ζ = 1 the poles are double, and found to the square root of the rounding only.
    """
    stiffness = {"translation": [60, 600, 6000], "rotation": 20}
    law = {"stiffness": stiffness, "damping": {"ratio": ratio}, "regularisation": 1e-9}
    p = problem(law=law, model_errors=RIGID_JOINTS)
    g, inertia = gains(p), moving_inertia(p)
    zero, one = np.zeros((6, 6)), np.eye(6)
    A = np.block(
        [[zero, one], [-np.linalg.solve(inertia, g["stiffness"]), -np.linalg.solve(inertia, g["damping"])]]
    )
    poles = np.linalg.eigvals(A)
    np.testing.assert_allclose(-poles.real / np.abs(poles), ratio, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(g["damping"], g["damping"].T)


def test_natural_inertia_is_that_of_the_plant() -> None:
    """Λ = (J M⁻¹ Jᵀ)⁻¹ at q₀ with the plant's numbers, whatever the law believes."""
    p = problem(model_errors={"link_inertia": -0.5})
    at = posture(p.law.robot, p.q, plant(p))
    expected = np.linalg.inv(at.jacobian @ np.linalg.solve(at.mass_matrix, at.jacobian.T))
    np.testing.assert_allclose(natural_inertia(p), expected, rtol=1e-9)


def test_target_inertia_by_ratio() -> None:
    """M_x = D K⁻¹ D / 4ζ²; with K = 60, D = 20 and ζ = 0.7 it is 3.40 kg (theory note 2.8)."""
    p = problem(law=RIGID)
    assert isinstance(p.law, RigidImpedanceLaw)
    M = gains(p)["target_inertia"]
    np.testing.assert_allclose(np.diag(M), [(20 / 1.4) ** 2 / 60] * 3 + [(10 / 1.4) ** 2 / 40] * 3)
    assert M[0, 0] == pytest.approx(3.40, abs=5e-3)
    np.testing.assert_allclose(M, target_inertia(gains(p)["stiffness"], gains(p)["damping"], 0.7), atol=1e-13)


def test_the_rigid_law_carries_its_motors_if_told() -> None:
    np.testing.assert_array_equal(gains(problem(law=RIGID))["carried_inertia"], np.zeros(7))
    p = problem(law=RIGID | {"motor_inertia": "carried"})
    np.testing.assert_array_equal(gains(p)["carried_inertia"], p.law.robot.motor_inertia)


def test_a_tool_moves_the_end_effector() -> None:
    """The offset is in the end effector's own axes, and the turn is of these axes."""
    bare = problem().home
    offset, turn = np.array([0.02, -0.03, 0.2]), np.array([0.1, 0.4, -0.2])
    home = problem(tool={"position": offset.tolist(), "rotation_vector": turn.tolist()}).home
    np.testing.assert_allclose(home.position, bare.position + bare.rotation @ offset, rtol=0, atol=1e-14)
    turned = bare.rotation @ Rotation.from_rotvec(turn).as_matrix()
    np.testing.assert_allclose(home.rotation, turned, rtol=0, atol=1e-14)


def test_law_and_plant_know_the_same_tool() -> None:
    p = problem(tool={"position": [0, 0, 0.1]}, model_errors={"link_inertia": 0.5})
    np.testing.assert_array_equal(plant(p)["tool_position"], model(p)["tool_position"])


ERRORS = {
    "joint_stiffness": ["joint_stiffness"],
    "joint_damping": ["joint_damping"],
    "motor_inertia": ["motor_inertia"],
    "link_inertia": ["link_mass", "link_moment", "link_inertia"],
}


@pytest.mark.parametrize("name", ERRORS)
@pytest.mark.parametrize("error", [0.5, -0.25])
def test_a_model_error_scales_its_own_numbers_and_no_others(name: str, error: float) -> None:
    """Of the law's model; the plant stays as it is."""
    p = problem(model_errors={name: error})
    exact = problem()
    np.testing.assert_array_equal(p.plant, exact.plant)
    np.testing.assert_array_equal(model(exact)["joint_stiffness"], plant(exact)["joint_stiffness"])
    for entry, value in plant(p).items():
        factor = 1 + error if entry in ERRORS[name] else 1.0
        np.testing.assert_allclose(model(p)[entry], factor * value, rtol=1e-15, atol=0, err_msg=entry)


def test_a_lighter_model_has_a_lighter_mass_matrix_throughout() -> None:
    """M is linear in masses and inertias: half of all is half of M, and half of ∇V."""
    p = problem(law={"gravity": "static"}, model_errors={"link_inertia": -0.5})
    true, believed = (posture(p.law.robot, p.q, m) for m in (plant(p), model(p)))
    np.testing.assert_allclose(believed.mass_matrix, 0.5 * true.mass_matrix, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(believed.gravity_torque, 0.5 * true.gravity_torque, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(believed.jacobian, true.jacobian)


def test_ratios_are_of_what_the_law_believes() -> None:
    """K_e = 10 K̂ and B_e = 0.01 B̂: the law knows no other K and B."""
    p = problem(model_errors={"joint_stiffness": 0.5, "motor_inertia": -0.5})
    np.testing.assert_allclose(gains(p)["shaped_stiffness"], 15 * p.law.robot.joint_stiffness)
    np.testing.assert_allclose(gains(p)["shaped_inertia"], 0.005 * p.law.robot.motor_inertia)
    carried = problem(law=RIGID | {"motor_inertia": "carried"}, model_errors={"motor_inertia": -0.5})
    np.testing.assert_allclose(gains(carried)["carried_inertia"], 0.5 * p.law.robot.motor_inertia)


def test_gravity_is_there_where_the_law_carries_it() -> None:
    for gravity, expected in (("robot", 0), ("motor", -9.81), ("static", -9.81)):
        p = problem(law={"gravity": gravity})
        np.testing.assert_array_equal(plant(p)["gravity"], [0, 0, expected])
        np.testing.assert_array_equal(model(p)["gravity"], [0, 0, expected])
    np.testing.assert_array_equal(plant(problem(law=RIGID | {"gravity": "model"}))["gravity"], [0, 0, -9.81])
    np.testing.assert_array_equal(plant(problem(law=RIGID))["gravity"], [0, 0, 0])


def test_the_motors_carry_the_weight_at_the_start() -> None:
    """θ − q = K⁻¹ ∇V(q) with the plant's numbers; zero if the robot compensates gravity itself."""
    p = problem(law={"gravity": "static"}, model_errors={"joint_stiffness": 0.5})
    at = posture(p.law.robot, p.q, plant(p))
    np.testing.assert_allclose(p.theta - p.q, at.gravity_torque / plant(p)["joint_stiffness"], rtol=1e-9)
    np.testing.assert_array_equal(p.q, POSTURE)
    np.testing.assert_array_equal(problem().theta, problem().q)


def accelerations(p: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return q̈ and θ̈ at the start, under the first event."""
    loop, n = ClosedLoop(p.law), p.law.robot.n
    start = {"q": p.q, "theta": p.theta, "tank_energy": p.tank.initial, "clock": 0}
    x = loop.state.pack(start | {"dq": np.zeros(n), "dtheta": np.zeros(n)})
    motion = p.events[0].motion
    assert motion is not None
    u = loop.inputs.pack({**motion, "F_e": p.events[0].F_e, "torque_noise": np.zeros(n)})
    rate = loop.state.unpack(np.array(loop.rhs(x, u, p.numbers)[0]).ravel())
    return rate["dq"], rate["dtheta"]


@pytest.mark.parametrize("gravity", ["robot", "static"])
def test_the_arm_starts_in_equilibrium(gravity: str) -> None:
    """q̈ = 0 and θ̈ = 0 but for rounding, which the inner loop amplifies.

    τ_a of up to 100 N m is known to K · ε · |q| = 1e4 · 2e-16 · 2 = 4e-12 N m, and K_G = K_e / K · B / B_e = 1000
    times that over B = 0.4 kg m² is 1e-8 rad/s²; a hundred operations may add up.
    """
    ddq, ddtheta = accelerations(problem(law={"gravity": gravity}))
    assert np.abs(ddq).max() < 1e-6
    assert np.abs(ddtheta).max() < 1e-6


def test_a_wrong_model_of_gravity_is_no_equilibrium() -> None:
    _, ddtheta = accelerations(problem(law={"gravity": "static"}, model_errors={"link_inertia": -0.5}))
    assert np.abs(ddtheta).max() > 1


def test_home_is_where_the_law_sees_the_end_effector() -> None:
    """f(φ) with φ of (11): not f(q), as the joints give way under the weight."""
    p = problem(law={"gravity": "static"})
    phi = p.q + 0.1 * (p.theta - p.q)  # K / K_e = 0.1
    np.testing.assert_allclose(p.home.position, posture(p.law.robot, phi, model(p)).pose.position, rtol=1e-12)
    assert np.abs(p.home.position - posture(p.law.robot, p.q, model(p)).pose.position).max() > 1e-5


def test_events_are_merged_in_the_order_of_time() -> None:
    p = problem(
        reference=[
            {"at": 2, "kind": "step", "by": [0, 0, 0.1]},
            {"at": 5, "kind": "hold"},
        ],
        forces=[
            {"from": 1, "to": 3, "force": [0, 4, 0]},
            {"from": 2, "to": 20, "force": [1, 0, 0], "moment": [0, 0, 2]},
        ],
    )
    assert [e.time for e in p.events] == [0, 1, 2, 3, 5]
    assert [e.motion is not None for e in p.events] == [True, False, True, False, True]
    assert [e.F_e.tolist() for e in p.events] == [
        [0, 0, 0, 0, 0, 0],
        [0, 4, 0, 0, 0, 0],
        [1, 4, 0, 0, 0, 2],
        [1, 0, 0, 0, 0, 2],
        [1, 0, 0, 0, 0, 2],
    ]


def test_a_force_from_the_start_is_there_at_the_start() -> None:
    p = problem(forces=[{"from": 0, "to": 10, "force": [0, 0, 3]}])
    assert [e.time for e in p.events] == [0]
    assert p.events[0].F_e[2] == 3


def test_without_events_the_reference_holds_the_home_pose() -> None:
    p = problem()
    (event,) = p.events
    assert event.motion is not None
    for clock in (0.0, 7.0):
        at = pose_at(event.motion, clock)
        np.testing.assert_array_equal(at.position, p.home.position)
        np.testing.assert_array_equal(at.rotation, p.home.rotation)


def test_a_step_adds_to_where_the_reference_is() -> None:
    p = problem(
        reference=[
            {"at": 1, "kind": "step", "by": [0, 0, 0.1]},
            {"at": 2, "kind": "step", "by": [0.1, 0, 0], "turn": [0, 0, 0.5]},
        ]
    )
    assert p.events[2].motion is not None
    at = pose_at(p.events[2].motion, 0.0)
    np.testing.assert_allclose(at.position, np.add(p.home.position, [0.1, 0, 0.1]), rtol=0, atol=1e-15)
    turned = Rotation.from_rotvec([0, 0, 0.5]).as_matrix() @ p.home.rotation
    np.testing.assert_allclose(at.rotation, turned, rtol=0, atol=1e-15)


def test_a_move_begins_and_ends_at_rest_where_it_should() -> None:
    """10 s³ − 15 s⁴ + 6 s⁵: half way at half time, 15/8 of the mean speed there, at rest at both ends."""
    by = np.array([0.1, -0.2, 0.3])
    p = problem(reference=[{"at": 1, "kind": "move", "by": by.tolist(), "duration": 2}])
    assert [e.time for e in p.events] == [0, 1]
    motion = p.events[1].motion
    assert motion is not None

    def moved(clock: float) -> np.ndarray:
        return pose_at(motion, clock).position - p.home.position

    h = 1e-4
    np.testing.assert_allclose(moved(0), 0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(moved(1), by / 2, rtol=0, atol=1e-14)
    np.testing.assert_allclose(moved(2), by, rtol=0, atol=1e-14)
    np.testing.assert_allclose((moved(1 + h) - moved(1 - h)) / (2 * h), 15 / 8 * by / 2, rtol=1e-6)
    for end in (0, 2):  # the velocity is of second order there: 30 (h/T)² of the mean
        np.testing.assert_allclose((moved(end + h) - moved(end - h)) / (2 * h), 0, rtol=0, atol=1e-7)
    np.testing.assert_allclose(moved(7), by, rtol=0, atol=1e-14)


def test_an_event_during_a_move_starts_from_there() -> None:
    p = problem(
        reference=[
            {"at": 1, "kind": "move", "by": [0, 0, 0.2], "duration": 2},
            {"at": 2, "kind": "hold"},
        ]
    )
    assert [e.time for e in p.events] == [0, 1, 2]
    assert p.events[2].motion is not None
    stopped = pose_at(p.events[2].motion, 9.0).position
    np.testing.assert_allclose(stopped - p.home.position, [0, 0, 0.1], rtol=0, atol=1e-14)


def test_a_circle_starts_at_the_set_point_along_its_first_axis() -> None:
    """Towards y at the start, with the centre one radius away in z; round once in one period."""
    circle = {"at": 1, "kind": "circle", "plane": ["y", "z"], "radius": 0.1, "period": 4}
    p = problem(reference=[{"at": 0.5, "kind": "step", "by": [0, 0, 0.1]}, circle])
    motion = p.events[2].motion
    assert motion is not None
    start = np.add(p.home.position, [0, 0, 0.1])
    np.testing.assert_allclose(pose_at(motion, 0).position, start, rtol=0, atol=1e-15)
    h = 1e-5
    velocity = (pose_at(motion, h).position - pose_at(motion, -h).position) / (2 * h)
    np.testing.assert_allclose(velocity, [0, 0.1 * 2 * np.pi / 4, 0], rtol=0, atol=1e-9)
    centre = np.add(start, [0, 0, 0.1])
    for clock in np.linspace(0, 4, 9):
        assert np.linalg.norm(pose_at(motion, clock).position - centre) == pytest.approx(0.1, abs=1e-15)
    np.testing.assert_allclose(pose_at(motion, 2).position, np.add(start, [0, 0, 0.2]), rtol=0, atol=1e-15)
    np.testing.assert_allclose(pose_at(motion, 4).position, start, rtol=0, atol=1e-15)


def test_a_robot_in_its_place() -> None:
    """A sweep gives the same scenario another robot; ratios follow."""
    robot = FlexibleJointRobot.load("iiwa14")
    softer = dataclasses.replace(robot, joint_stiffness=np.full(7, 4e3))
    p = problem(robot=softer)
    assert p.law.robot is softer
    np.testing.assert_array_equal(gains(p)["shaped_stiffness"], np.full(7, 4e4))


def test_the_tank_is_that_of_the_scenario() -> None:
    p = problem(tank={"initial": 3, "floor": 0.1, "low": 0.2, "cap": 5, "fill": 0.5, "accounting": "signed"})
    assert p.tank == (3, 0.1, 5, True)
    numbers = p.parts.unpack("tank", p.numbers)
    assert {k: float(v) for k, v in numbers.items()} == {
        "tank_fill": 0.5,
        "tank_floor": 0.1,
        "tank_low": 0.2,
        "tank_cap": 5,
        "tank_band": 0.05,
        "tank_signed": 1,
    }
    assert float(problem().parts.unpack("tank", problem().numbers)["tank_cap"]) == NO_CAP


def test_static_gravity_refuses_joints_that_are_too_soft_for_its_fixed_point() -> None:
    """Eight steps of a fixed point that contracts by 14 % leave 1e-7 of the weight; softer is refused."""
    message = refused(ValueRangeError, law={"gravity": "static", "shaped_stiffness": {"ratio": 0.03}})
    assert message.startswith(
        "shaped_stiffness is too soft for gravity: static, the default; got the weight's slope is 14% of K_e"
    )
    assert message.endswith(
        "needs at most 10%, so that its fixed point is found; try a stiffer shaped_stiffness, or gravity: motor"
    )


def test_damping_by_ratio_holds_for_anisotropic_rotation() -> None:
    """K_o is given in the axes of the reference, Λ and D_x are in world axes: the modes of the true Hessian count."""
    stiffness = {"translation": [60, 600, 6000], "rotation": [100, 10, 1]}
    law = {"stiffness": stiffness, "damping": {"ratio": 0.7}, "regularisation": 1e-9}
    p = problem(law=law, model_errors=RIGID_JOINTS)
    g, inertia, R = gains(p), moving_inertia(p), p.home.rotation
    assert np.abs(R - np.eye(3)).max() > 0.5  # else the frames would be the same
    hessian = np.zeros((6, 6))
    hessian[:3, :3], hessian[3:, 3:] = g["stiffness"][:3, :3], R @ g["stiffness"][3:, 3:] @ R.T
    zero, one = np.zeros((6, 6)), np.eye(6)
    A = np.block([[zero, one], [-np.linalg.solve(inertia, hessian), -np.linalg.solve(inertia, g["damping"])]])
    poles = np.linalg.eigvals(A)
    np.testing.assert_allclose(-poles.real / np.abs(poles), 0.7, rtol=0, atol=1e-6)


def test_a_scenario_that_was_made_without_checks_is_checked() -> None:
    values = dict(shipped_scenario("fig1")) | {"posture": (float("nan"),) * 7}
    scenario = Scenario.model_construct(**values)
    with pytest.raises(ScenarioError, match="posture"):
        resolve(scenario)
