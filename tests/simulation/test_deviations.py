"""A robot that differs from its description: the plant alone is changed, rests, and the law knows nothing of it."""

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np
import pytest

from passiflex.control.posture import posture
from passiflex.errors import SizeError
from passiflex.problems.altered import altered
from passiflex.problems.problem import SampledProblem
from passiflex.problems.resolution import SCALED
from passiflex.robots.flexible import RobotState
from passiflex.simulation import ClosedLoop, Problem, parse_scenario, resolve, simulate
from worlds import world

CONTINUOUS: dict[str, Any] = {"control": None, "tank": None}
EACH: dict[str, list[float]] = {
    "joint_stiffness": [0.2, -0.3],
    "joint_damping": [-0.5, 1.0],
    "motor_inertia": [0.1, -0.2],
    "link_inertia": [0.1, -0.2],
}


def problem(**changes: Any) -> Problem:
    return resolve(world(**changes))


def plant(p: Problem) -> dict[str, np.ndarray]:
    return p.law.robot.layout.unpack(p.plant)


def model(p: Problem) -> dict[str, np.ndarray]:
    return p.law.robot.layout.unpack(p.model)


@pytest.mark.parametrize(("section", "kept"), [("deviations", model), ("model_errors", plant)])
@pytest.mark.parametrize("name", EACH)
@pytest.mark.parametrize("control", [{}, CONTINUOUS], ids=["sampled", "continuous"])
def test_each_section_scales_its_own_numbers_of_its_own_side(
    section: str, kept: Any, name: str, control: dict[str, Any]
) -> None:
    """Robot = description × (1 + deviations), model = description × (1 + model_errors), joint by joint or all alike."""
    described = problem(**control)
    changed = {plant: model, model: plant}[kept]
    for value in (EACH[name], 0.5, [0.5]):
        p = problem(**control, **{section: {name: value}})
        np.testing.assert_array_equal(kept(p)["link_mass"], kept(described)["link_mass"])
        for entry, number in plant(described).items():
            np.testing.assert_array_equal(kept(p)[entry], number, err_msg=entry)
            one = np.resize(value, 2) if entry in SCALED[name] else np.zeros(2)
            if entry in SCALED[name]:
                number = number * (1 + one).reshape(-1, *[1] * (number.ndim - 1))
            np.testing.assert_allclose(changed(p)[entry], number, rtol=1e-15, err_msg=entry)


def test_both_sides_differ_from_the_description_and_not_from_each_other() -> None:
    p = problem(deviations={"joint_stiffness": 0.2}, model_errors={"joint_stiffness": 0.5})
    own = p.law.robot.joint_stiffness
    np.testing.assert_allclose(plant(p)["joint_stiffness"], 1.2 * own, rtol=1e-15)
    np.testing.assert_allclose(model(p)["joint_stiffness"], 1.5 * own, rtol=1e-15)
    gains = p.law.layout.unpack(p.gains)
    np.testing.assert_allclose(
        gains["shaped_stiffness"], 1.5 * own, rtol=1e-15
    )  # ratio 1 of what the law believes


@pytest.mark.parametrize("section", ["deviations", "model_errors"])
@pytest.mark.parametrize("name", EACH)
def test_a_list_fits_the_robot(section: str, name: str) -> None:
    with pytest.raises(SizeError) as error:
        problem(**{section: {name: [0.1, 0.1, 0.1]}})
    assert str(error.value) == (
        f"{section}.{name} does not fit robot 'planar2r'; got 3 numbers; needs one number or 2"
    )


@pytest.mark.parametrize("control", [{}, CONTINUOUS], ids=["sampled", "continuous"])
def test_the_arm_rests_under_its_true_weight(control: dict[str, Any]) -> None:
    """K (θ − q) = ∇V with links of 3 and 2 kg, 10 % heavier and 20 % lighter, and joints 20 % stiffer, 30 % softer."""
    p = problem(law={"gravity": "static"}, deviations=EACH, **control)
    (a, b), g, m1, m2 = p.q, 9.81, 3 * 1.1, 2 * 0.8
    elbow = m2 * g * 0.2 * np.cos(a + b)
    weight = np.array([(m1 * 0.25 + m2 * 0.5) * g * np.cos(a) + elbow, elbow])
    np.testing.assert_allclose(
        p.theta - p.q, weight / (p.law.robot.joint_stiffness * np.array([1.2, 0.7])), rtol=1e-9
    )
    if isinstance(p, SampledProblem):
        np.testing.assert_allclose(p.held, weight, rtol=1e-12)


def accelerations(p: Problem, tau_m: np.ndarray) -> np.ndarray:
    """Return q̈ and θ̈ of the robot at the start, under a motor torque."""
    robot, zero = p.law.robot, cs.SX.zeros(p.law.robot.n)
    vector, m = robot.layout.symbols("m")
    x = RobotState(cs.SX(p.q), cs.SX(p.theta), zero, zero)
    found = robot.acceleration(x, cs.SX(tau_m), zero, m)
    both = cs.Function("start", [vector], [cs.vertcat(found.ddq, found.ddtheta)])
    return np.array(both(p.plant[: robot.layout.size])).ravel()


@pytest.mark.parametrize("gravity", ["static", "robot"])
def test_the_deviating_robot_starts_in_equilibrium(gravity: str) -> None:
    """Under the torque that the motors hold until the first command: q̈ = θ̈ = 0, to K · ε · |q| over the inertia."""
    p = problem(law={"gravity": gravity}, deviations=EACH)
    assert isinstance(p, SampledProblem)
    assert np.abs(accelerations(p, p.held)).max() < 1e-8
    if gravity == "static":
        described = problem(law={"gravity": gravity})
        assert isinstance(described, SampledProblem)
        assert np.abs(accelerations(p, described.held)).max() > 1


def closed_loop(p: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return q̈ and θ̈ of the loop in continuous time at the start."""
    loop, zero = ClosedLoop(p.law), np.zeros(p.law.robot.n)
    start = {
        "q": p.q,
        "theta": p.theta,
        "tank_energy": p.tank.initial,
        "clock": 0,
        "dq": zero,
        "dtheta": zero,
    }
    motion = p.events[0].motion
    assert motion is not None
    u = loop.inputs.pack({**motion, "F_e": p.events[0].F_e, "torque_noise": zero})
    rate = loop.state.unpack(np.array(loop.rhs(loop.state.pack(start), u, p.numbers)[0]).ravel())
    return rate["dq"], rate["dtheta"]


@pytest.mark.parametrize(
    ("deviations", "errors", "motors_rest"),
    [
        (EACH, EACH, True),
        ({name: EACH[name] for name in ("joint_damping", "motor_inertia")}, {}, True),
        ({"link_inertia": EACH["link_inertia"]}, {}, False),
    ],
    ids=["the law knows", "it need not know", "it carries another weight"],
)
def test_the_closed_loop_starts_in_equilibrium_if_the_law_carries_the_true_weight(
    deviations: dict[str, Any], errors: dict[str, Any], motors_rest: bool
) -> None:
    """The links rest in any case; what moves the motors is the weight that the law gets wrong."""
    p = problem(**CONTINUOUS, law={"gravity": "static"}, deviations=deviations, model_errors=errors)
    ddq, ddtheta = closed_loop(p)
    assert np.abs(ddq).max() < 1e-8
    assert (np.abs(ddtheta).max() < 1e-7) == motors_rest
    assert motors_rest or np.abs(ddtheta).max() > 1


def test_a_law_that_knows_the_deviations_keeps_the_arm_where_it_is() -> None:
    """Through time, sampled: the first command of the law is the torque that was held."""
    s = world(law={"gravity": "static"}, deviations=EACH, model_errors=EACH, reference=None, duration=0.05)
    run = simulate(s)
    assert run.failure == ""
    assert np.abs(run["q"] - np.array(s.posture)).max() < 1e-9
    strange = simulate(world(law={"gravity": "static"}, deviations=EACH, reference=None, duration=0.05))
    assert np.abs(strange["q"] - np.array(s.posture)).max() > 1e-4


@pytest.mark.parametrize("damping", [{"translation": 40}, {"translation": None, "ratio": 0.7}])
def test_the_law_knows_nothing_of_the_deviations(damping: dict[str, Any]) -> None:
    """Only what the robot does is another: all of the law's numbers stay, those of its actions too."""
    changes = {
        "law": {"gravity": "static", "damping": damping},
        "actions": {"posture_stiffness": 30},
        "model_errors": {"link_inertia": [0.2, 0.3]},
    }
    described, deviating = problem(**changes), problem(**changes, deviations=EACH)
    assert isinstance(described, SampledProblem)
    assert isinstance(deviating, SampledProblem)
    for name in ("model", "gains"):
        np.testing.assert_array_equal(getattr(deviating, name), getattr(described, name))
    first = described.plant.size
    np.testing.assert_array_equal(deviating.numbers[first:], described.numbers[first:])
    assert np.abs(deviating.plant - described.plant).max() > 0.1


@pytest.mark.parametrize("gravity", ["static", "robot"])
def test_deviations_are_what_altering_the_plant_does(gravity: str) -> None:
    changes = {
        "law": {"gravity": gravity},
        "reference": [{"at": 0.1, "kind": "move", "by": [0.02, 0, 0.01], "duration": 0.1}],
        "model_errors": {"joint_stiffness": [0.3, -0.2]},
    }
    ours = problem(**changes, deviations=EACH)
    theirs = altered(problem(**changes), plant={k: plant(ours)[k] for v in SCALED.values() for k in v})
    assert isinstance(ours, SampledProblem)
    assert isinstance(theirs, SampledProblem)
    for name in ("plant", "model", "gains", "theta"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-14)
    np.testing.assert_allclose(ours.numbers, theirs.numbers, rtol=1e-14)
    np.testing.assert_allclose(ours.held, theirs.held, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(ours.home.position, theirs.home.position, atol=1e-15)


def test_link_inertia_is_that_of_the_link_which_the_joint_moves() -> None:
    """M is linear in the bodies: what two links add together is what each adds alone, and the last acts on all."""
    described = problem()
    robot, q = described.law.robot, described.q

    def mass_matrix(value: list[float]) -> np.ndarray:
        return posture(robot, q, plant(problem(deviations={"link_inertia": value}))).mass_matrix

    own = posture(robot, q, plant(described)).mass_matrix
    first, last = mass_matrix([0.5, 0]) - own, mass_matrix([0, 0.5]) - own
    np.testing.assert_allclose(mass_matrix([0.5, 0.5]) - own, first + last, atol=1e-14)
    np.testing.assert_allclose(mass_matrix([0.5, 0.5]), 1.5 * own, rtol=1e-13)
    assert first[0, 0] > 0.01
    np.testing.assert_allclose(first[[0, 1, 1], [1, 0, 1]], 0, atol=1e-15)
    assert np.linalg.eigvalsh(last).min() > 0


def test_deviations_are_in_the_stored_configuration() -> None:
    p = problem(deviations=EACH, model_errors={"joint_damping": [0.1, 0.2]})
    again = resolve(parse_scenario(p.text))
    np.testing.assert_array_equal(again.plant, p.plant)
    np.testing.assert_array_equal(again.model, p.model)
    assert again.text == p.text
