"""From a scenario to numbers: load the robot, build the law, place the start, lay out the events."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from passiflex.control.law import AbstractLaw
from passiflex.control.motion import Pose
from passiflex.control.posture import SINGULAR, Posture, freest_turns, held_jacobian, posture
from passiflex.errors import ArgumentError, SizeError, ValueRangeError
from passiflex.loops.closed_loop import ClosedLoop
from passiflex.problems.placed import posture_at
from passiflex.problems.problem import Noise, Problem, SampledProblem
from passiflex.problems.sampling import Known, sampled_parts
from passiflex.problems.surroundings import elements_of
from passiflex.problems.tank_numbers import tank_gains, tank_start
from passiflex.problems.timeline import timeline
from passiflex.robots.carried import carrying
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.scenarios.model_errors import AbstractRelative
from passiflex.scenarios.posture import AtPose
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.scenario_file import parse_scenario

Array = NDArray[np.float64]

WEIGHTLESS = (0.0, 0.0, 0.0)
SCALED = {
    "joint_stiffness": ("joint_stiffness",),
    "joint_damping": ("joint_damping",),
    "motor_inertia": ("motor_inertia",),
    "link_inertia": ("link_mass", "link_moment", "link_inertia"),
}
"""Entry of `deviations` and `model_errors` → the numbers of `FlexibleJointRobot.layout` that it scales."""
SLOWEST_CONTRACTION = 0.1
"""Largest |∇²V| / K_e for the static compensation: its eight steps then reach 1e-8 of the weight."""
REGULAR = 1e-6
"""Regularisation [1/kg] from which a law may start in a singular posture; less only guards round-off."""


PLACES = 3
"""Joints that hold a position."""
PLACED = 64
"""Poses whose angles are remembered."""
_placed: dict[Hashable, tuple[float, ...]] = {}
"""Robot, tool and pose → the joint angles that were found."""


def resolve(scenario: Scenario, robot: FlexibleJointRobot | None = None) -> Problem:
    """Return the problem that a scenario describes, with another robot in place of its own if one is given.

    Raises
    ------
    PassiflexError
        If the robot cannot be loaded, a size does not fit it, a start is outside the robot's limits or singular.
    """
    if not isinstance(scenario, Scenario):
        raise ArgumentError(
            scenario, "a scenario", "load_scenario for a file, or simulate, which takes its path"
        )
    scenario = _checked(scenario)
    if robot is None:
        robot = FlexibleJointRobot.load(scenario.robot)
    else:  # what is stored beside the result must not pass for the scenario's own robot
        scenario = scenario.model_copy(update={"robot": f"{robot.name}, changed in memory"})
    law = scenario.law.build(robot)
    described, plant, model = _robot_numbers(scenario, law)
    scenario = _with_angles(scenario, robot, described)
    scenario = scenario.model_copy(update={"law": scenario.law.settled(float(described["link_mass"].sum()))})
    q = _start(scenario, robot)
    at_start = posture(robot, q, plant)
    _refuse_too_few(law, at_start)
    _refuse_singular(scenario, held_jacobian(law.task, at_start))
    gains = scenario.law.gains(law, model, posture(robot, q, model))
    if law.gravity.searches and law.shapes:
        _refuse_soft(robot, q, model, gains["shaped_stiffness"])
    theta = q + at_start.gravity_torque / plant["joint_stiffness"]
    softer = model["joint_stiffness"] / gains.get("shaped_stiffness", model["joint_stiffness"])
    home = posture(robot, q + softer * (theta - q), model).pose
    # The law's own damping goes by the robot as described; its weight is the true one.
    start = at_start._replace(mass_matrix=posture(robot, q, described).mass_matrix)
    known = Known(elements_of(scenario, robot, at_start.pose, q), plant, model, q, start)
    common: dict[str, Any] = _as_written(scenario) | {
        "law": law,
        "elements": known.elements,
        "q": q,
        "theta": theta,
        "home": home,
        "events": timeline(scenario, home),
    }
    if scenario.control is not None:
        return SampledProblem(**common, **sampled_parts(scenario, scenario.control, law, gains, known))
    loop = ClosedLoop(law, known.elements)
    values: dict[str, dict[str, Any]] = {
        "plant": loop.plant.numbers(plant),
        "model": model,
        "gains": gains,
        "tank": tank_gains(scenario),
    }
    return Problem(**common, numbers=loop.parameters.pack(values))


def _checked(scenario: Scenario) -> Scenario:
    """Return the scenario validated anew, as it may be a changed copy."""
    try:
        data = scenario.model_dump(by_alias=True, exclude_none=True, warnings=False)
        return Scenario.model_validate(data)
    except ValidationError:  # with the line and column that a mistake has in the scenario's own text
        return parse_scenario(scenario.to_yaml(), source=f"scenario {scenario.name!r}")


def _as_written(scenario: Scenario) -> dict[str, Any]:
    """Return what a problem has of its scenario as it is."""
    noise = scenario.noise
    return {
        "name": scenario.name,
        "tank": tank_start(scenario),
        "noise": noise
        and Noise(noise.torque_variance, noise.hold, noise.link_deviation, noise.motor_deviation),
        "duration": scenario.duration,
        "output_interval": scenario.output_interval,
        "tolerance": scenario.tolerance,
        "seed": scenario.seed,
        "text": scenario.to_yaml(),
    }


def _with_angles(scenario: Scenario, robot: FlexibleJointRobot, described: dict[str, Array]) -> Scenario:
    """Return the scenario with joint angles where it has a pose: the run then says which they were."""
    if not isinstance(scenario.posture, AtPose):
        return scenario
    pose, near = scenario.posture.pose, scenario.posture.near
    turned = pose.rotation_vector is not None
    if near is not None and len(near) != robot.n:
        raise SizeError(
            f"posture.near does not fit robot {robot.name!r}",
            got=f"{len(near)} angles",
            needs=f"{robot.n} angles in rad",
        )
    turn = Rotation.from_rotvec(pose.rotation_vector or (0.0, 0.0, 0.0)).as_matrix()
    goal = Pose(np.array(pose.position), turn)
    key = (
        robot,
        described["tool_position"].tobytes(),
        described["tool_rotation"].tobytes(),
        scenario.posture,
    )
    if key not in _placed:  # as campaigns ask for the same one a thousand times
        while len(_placed) >= PLACED:
            _placed.pop(next(iter(_placed)))
        begin = None if near is None else np.array(near)
        found = posture_at(robot, described, goal, turned=turned, near=begin)
        _placed[key] = tuple(found.tolist())
    return scenario.model_copy(update={"posture": _placed[key]})


def _start(scenario: Scenario, robot: FlexibleJointRobot) -> Array:
    q = np.array(scenario.posture, dtype=float)
    if q.shape != (robot.n,):
        raise SizeError(
            f"posture does not fit robot {robot.name!r}",
            got=f"{q.size} angles",
            needs=f"{robot.n} angles in rad",
        )
    outside = np.flatnonzero((q < robot.position_limit[:, 0]) | (q > robot.position_limit[:, 1]))
    if outside.size:
        i = int(outside[0])
        low, high = robot.position_limit[i]
        raise ValueRangeError(
            f"posture: joint {i + 1} of {robot.name!r} is outside its limits",
            got=f"{q[i]:g} rad",
            needs=f"{low:.4g} to {high:.4g} rad",
            try_="degrees written with their unit, as '30 deg'" if np.abs(q[i]) > 7 else None,
        )
    return q


def _refuse_too_few(law: AbstractLaw, at_start: Posture) -> None:
    """Raise ValueRangeError for a pose that has more directions to hold than the robot has joints."""
    held, n = len(law.task.held), law.robot.n
    if law.task.turns and n < held:
        way = "task: position"
        if n >= PLACES:
            turns = freest_turns(at_start, 6 - n)
            names = " and ".join("xyz"[i] for i in turns)
            written = ", ".join("0" if i in turns else "30" for i in range(3))
            way = (
                f"rotation: [{written}] in stiffness and damping, so that the end effector is free to turn about its "
                f"{names}, about which the arm can turn it least at this start; or task: position"
            )
        raise ValueRangeError(
            f"task 'pose' holds {held} directions, more than robot {law.robot.name!r} can move in",
            got=f"{n} joints",
            needs="at least as many joints as directions that are held",
            try_=way,
        )


def _refuse_singular(scenario: Scenario, jacobian: Array) -> None:
    """Raise ValueRangeError where Λ of (31) does not exist and the law needs it."""
    values = np.linalg.svd(jacobian, compute_uv=False)
    enough = values.size == len(jacobian)
    rigid, regularisation = not scenario.law.shapes, scenario.law.regularisation or 0.0
    if values[-1] >= SINGULAR * values[0] and (enough or (regularisation > 0 and not rigid)):
        return
    if regularisation >= REGULAR and not rigid:
        return
    got = (
        f"smallest singular value of J {values[-1]:.2e}"
        if values.size == len(jacobian)
        else f"{values.size} joints"
    )
    raise ValueRangeError(
        f"posture is singular for task {scenario.law.task!r}"
        + (", where the rigid law is not defined" if rigid else ""),
        got=got,
        needs=f"an end effector that can move in all {len(jacobian)} directions of the task",
        try_="another posture, task: position, or "
        + ("the impedance law" if rigid else f"regularisation of {REGULAR:g} 1/kg or more"),
    )


def _refuse_soft(robot: FlexibleJointRobot, q: Array, model: dict[str, Array], K_e: Array) -> None:
    """Raise ValueRangeError where the fixed point of the static compensation contracts too slowly."""
    step = 1e-5
    slopes = [
        (posture(robot, q + h, model).gravity_torque - posture(robot, q - h, model).gravity_torque)
        / (2 * step)
        for h in step * np.eye(robot.n)
    ]
    contraction = float(np.abs(np.linalg.eigvals(np.array(slopes).T / K_e[:, None])).max())
    if contraction > SLOWEST_CONTRACTION:
        raise ValueRangeError(
            "shaped_stiffness is too soft for gravity: static, the default",
            got=f"the weight's slope is {contraction:.0%} of K_e",
            needs=f"at most {SLOWEST_CONTRACTION:.0%}, so that its fixed point is found",
            try_="a stiffer shaped_stiffness, or gravity: motor",
        )


def _robot_numbers(scenario: Scenario, law: AbstractLaw) -> tuple[dict[str, Array], ...]:
    """Return the robot's numbers as they are described, as they are, and as the law believes them."""
    robot = law.robot
    described = robot.nominal(None if law.gravity.in_model else WEIGHTLESS)
    arm = robot.arm.chain.with_tool(scenario.tool.position, scenario.tool.rotation_vector)
    described |= {"tool_position": arm.tip_xyz, "tool_rotation": arm.tip_rotation}
    if scenario.tool.mass:
        described |= carrying(robot.arm.chain, described, scenario.tool.body)
    plant = _scaled(described, "deviations", scenario.deviations, robot)
    model = _scaled(described, "model_errors", scenario.model_errors, robot)
    if (payload := scenario.payload) is not None:
        plant |= carrying(robot.arm.chain, plant, payload.body)
        if payload.known:
            described |= carrying(robot.arm.chain, described, payload.body)
            model |= carrying(robot.arm.chain, model, payload.body)
    return described, plant, model


def _scaled(
    described: dict[str, Array], entry: str, relative: AbstractRelative, robot: FlexibleJointRobot
) -> dict[str, Array]:
    """Return the robot's numbers times 1 + `relative`, which is the scenario's section `entry`."""
    scaled = dict(described)
    for name, numbers in SCALED.items():
        value = np.asarray(getattr(relative, name))
        if value.size not in (1, robot.n):
            raise SizeError(
                f"{entry}.{name} does not fit robot {robot.name!r}",
                got=f"{value.size} numbers",
                needs=f"one number or {robot.n}",
            )
        for number in numbers:
            rows = described[number].reshape(robot.n, -1)
            scaled[number] = (rows * (1 + value.reshape(-1, 1))).reshape(described[number].shape)
    return scaled
