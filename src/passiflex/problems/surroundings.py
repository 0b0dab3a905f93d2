"""What touches the robot of a scenario, as elements; and what the law exerts to hold up the loads that it knows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.control.motion import Pose
from passiflex.elements import AbstractElement, MotorFriction, SpeedBrake, StickingFriction
from passiflex.elements.end_stops import NO_END, EndStops
from passiflex.elements.surface import Surface
from passiflex.loops.plant import Elements
from passiflex.problems.per_joint import per_joint
from passiflex.problems.problem import Lasting
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.frames import world_frames
from passiflex.scenarios.environment import labelled
from passiflex.scenarios.held_settings import Load
from passiflex.scenarios.motor_settings import MotorSettings
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.touching import Site

Array = NDArray[np.float64]

BRAKING = 0.01
"""Time [s] within which a motor comes back to its speed limit."""


def elements_of(scenario: Scenario, robot: FlexibleJointRobot, at: Pose, q: Array) -> Elements:
    """Return what touches a scenario's robot: friction first, whose books a sampled run always has; all drags are one.

    Parameters
    ----------
    at: Where the end effector starts.
    q: Where the joints do (n,).

    Raises
    ------
    SizeError, ValueRangeError
        For friction of another number of joints, or an element that the robot is within at the start.
    """
    motors = scenario.motors or MotorSettings()
    coulomb, viscous = (
        per_joint(robot, f"motors.{name}", getattr(motors, name))
        for name in ("coulomb_friction", "viscous_friction")
    )
    rubs = bool(np.any(coulomb) or np.any(viscous))
    friction: AbstractElement = MotorFriction(rubs, coulomb, viscous, motors.friction_width)
    if motors.friction == "sticks" and np.any(coulomb):
        friction = StickingFriction(
            True, coulomb, viscous, motors.static_friction, motors.stribeck_speed, motors.break_away
        )
    brakes = _brakes(motors, robot)
    entries = labelled(scenario.environment).items()
    site = Site(robot, at, scenario.hand)
    others = {e.structure: e for e in (entry.build(name, site) for name, entry in entries)}
    for element in others.values():
        element.require_apart(at)
        if isinstance(element, EndStops):
            element.require_between(q)
        if isinstance(element, Surface):
            element.require_outside(world_frames(robot.arm.chain, q[None]).position[0, 1:-1])
    return (*[friction] * (rubs or scenario.control is not None), *brakes, *others.values())


def _brakes(motors: MotorSettings, robot: FlexibleJointRobot) -> Elements:
    """Return what brakes motors beyond their speed limits, if they have any."""
    if motors.speed_limit == "none":
        return ()
    limit = (
        robot.velocity_limit
        if motors.speed_limit == "robot"
        else per_joint(robot, "motors.speed_limit", motors.speed_limit)
    )
    return (SpeedBrake(limit=np.minimum(limit, NO_END), brake=robot.motor_inertia / BRAKING),)


def feedforward_of(scenario: Scenario, robot: FlexibleJointRobot) -> tuple[Lasting, ...]:
    """Return what the end effector is to exert: what was asked for, and what holds up the loads that the law knows."""
    asked = [Lasting(f.start, f.end, np.array([*f.force, *f.moment])) for f in scenario.feedforward]
    down = np.array(robot.arm.chain.gravity)
    known = [e for e in scenario.environment if isinstance(e, Load) and e.known]
    return (*asked, *(Lasting(e.start, e.end, np.array([*-e.mass * down, 0, 0, 0])) for e in known))
