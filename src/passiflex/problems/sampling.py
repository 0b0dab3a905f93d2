"""From the settings of a sampled run to numbers: controller, sensors, motors, and what changes in flight."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.control.law import AbstractLaw
from passiflex.control.posture import Posture
from passiflex.control.tank import NO_CAP
from passiflex.errors import SizeError
from passiflex.loops.plant import Elements
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.problems.per_joint import per_joint
from passiflex.problems.problem import FROM_THE_START, GainChange
from passiflex.problems.surroundings import feedforward_of
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.controller import SampledController
from passiflex.sampled.measurement_bound import BEND
from passiflex.sampled.motors import UNLIMITED_TORQUE
from passiflex.sampled.readings import Lateness, Readings
from passiflex.sampled.said import SaysLess
from passiflex.sampled.sayable import SAYABLE
from passiflex.sampled.sensors import UNFILTERED, AbstractSensorEffect
from passiflex.scenarios.action_settings import Actions
from passiflex.scenarios.control_settings import Control
from passiflex.scenarios.motor_settings import MotorSettings
from passiflex.scenarios.noise_settings import Noise
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.sensor_settings import SensorSettings
from passiflex.scenarios.setpoints import Table
from passiflex.scenarios.tank_settings import TankSettings

Array = NDArray[np.float64]

POSTURE_RATIO = 0.7
"""Damping ratio of the spring to a posture, joint by joint, unless its damping is given."""
VELOCITY_GAIN, ACCELERATION_GAIN = 0.3, 0.05
"""Of the matched inner loop's estimates: of those that were tried at 1 kHz, the best compromise between the
torque's noise and the lag in q̇, which acts as further inertia; from 0.2 on the second gain destabilises."""


class Known(NamedTuple):
    """What of a problem is known before its loop.

    Attributes
    ----------
    plant, model: Numbers of the robot, and of it as the law takes it for, by name.
    q: Start (n,).
    start: The arm there: its weight is the true one, its inertia that of the description.
    """

    elements: Elements
    plant: dict[str, Array]
    model: dict[str, Array]
    q: Array
    start: Posture


def sampled_parts(
    scenario: Scenario, control: Control, law: AbstractLaw, gains: dict[str, Array], known: Known
) -> dict[str, Any]:
    """Return what a sampled problem has beside one in continuous time.

    Raises
    ------
    SizeError
        For a list of numbers that does not fit the robot's joints.
    """
    tank, robot, model = scenario.tank, law.robot, known.model
    motors, sensors, noise = (
        scenario.motors or MotorSettings(),
        scenario.sensors or SensorSettings(),
        scenario.noise,
    )
    noisy = noise is not None and bool(noise.link_deviation or noise.motor_deviation)
    late = sensors.lateness.in_periods(1 / control.rate)
    controller = SampledController(
        law,
        tank.build() if tank and law.has_tank else None,
        control.build_external(),
        control.build_inner(),
        actions=scenario.actions is not None or bool(feedforward_of(scenario, robot)),
        compensates=scenario.actions is not None and scenario.actions.compensates,
        held_task=control.build_task(),
        readings=Readings.of(late, noisy=noisy),
    )
    moved = np.diag(known.start.mass_matrix) + gains.get("shaped_inertia", model["motor_inertia"])
    loop = SampledLoop(controller, known.elements)
    numbers = loop.parameters.pack(
        {
            "plant": loop.plant.numbers(known.plant),
            "model": model,
            "gains": gains,
            "fallback": _fallback(control, scenario, robot, model, gains),
            "tank": _tank(tank),
            "actions": _actions(scenario.actions or Actions(), robot, known.q, moved),
            "observer": {"bandwidth": _pole(control.observer_bandwidth)},
            "inner": {
                "period": 1 / control.rate,
                "velocity_gain": VELOCITY_GAIN,
                "acceleration_gain": ACCELERATION_GAIN,
                "task_periods": control.task_periods,
            },
            "errors": _errors(control, sensors, noise, robot) | late_errors(late),
            "sensors": _sensors(sensors, robot) | late_sensors(late),
            "limits": _limits(motors, robot),
        }
    )
    return {
        "controller": controller,
        "numbers": numbers,
        "period": 1 / control.rate,
        "delay": control.delay,
        "jitter": control.jitter,
        "missed": control.missed,
        "lost": tuple((burst.at, burst.periods) for burst in control.lost),
        "allow_unstable": control.allow_unstable,
        "held": known.start.gravity_torque,
        "lateness": sensors.lateness,
        "gain_changes": _gain_changes(scenario, gains),
        "feedforward": feedforward_of(scenario, robot),
        "effects": _effects(sensors, model),
    }


def _effects(sensors: SensorSettings, model: dict[str, Array]) -> tuple[AbstractSensorEffect, ...]:
    """Return what of the readings is completed."""
    if len(sensors.says) == len(SAYABLE):
        return ()
    K = tuple(model["joint_stiffness"].tolist())
    return (SaysLess(sensors.says, K, _pole(sensors.velocity_filter)),)


def _pole(frequency: float) -> float:
    """Return the pole [rad/s] of a frequency [Hz]."""
    return UNFILTERED if math.isinf(frequency) else 2 * math.pi * frequency


def _fallback(
    control: Control,
    scenario: Scenario,
    robot: FlexibleJointRobot,
    model: dict[str, Array],
    gains: dict[str, Array],
) -> dict[str, Array]:
    if not scenario.law.shapes:
        return gains
    wanted = control.fallback
    changed = {
        name: getattr(wanted, name).resolve(model[own], f"control.fallback.{name}", robot.name)
        for name, own in (("shaped_stiffness", "joint_stiffness"), ("shaped_inertia", "motor_inertia"))
    }
    for name, matrix in (("stiffness", wanted.stiffness), ("damping", wanted.damping)):
        if matrix is not None:
            changed[name] = matrix.full()
    return gains | changed


def _tank(tank: TankSettings | None) -> dict[str, float]:
    t = tank or TankSettings()
    return {
        "tank_floor": t.floor,
        "tank_low": t.low,
        "tank_cap": min(t.cap, NO_CAP),
        "tank_power": min(t.power, NO_CAP),
        "tank_trip": t.floor / 2 if t.trip is None else t.trip,
        "tank_signed": float(t.signed),
        "tank_fill": t.fill,
        "tank_braking": t.braking,
    }


def _actions(
    actions: Actions, robot: FlexibleJointRobot, q: Array, inertia: Array
) -> dict[str, Array | float]:
    """Return the numbers of the actions; `inertia` (n,) is what each joint moves at the start, B_e included."""
    posture = q if actions.posture is None else np.array(actions.posture)
    if posture.shape != (robot.n,):
        raise SizeError(
            f"actions.posture does not fit robot {robot.name!r}",
            got=f"{posture.size} angles",
            needs=f"{robot.n} angles in rad",
        )
    stiffness = per_joint(robot, "actions.posture_stiffness", actions.posture_stiffness)
    damping: ArrayLike = 2 * POSTURE_RATIO * np.sqrt(stiffness * inertia)
    if actions.posture_damping is not None:
        damping = actions.posture_damping
    return {
        "posture_stiffness": stiffness,
        "posture_damping": per_joint(robot, "actions.posture_damping", damping),
        "posture": posture,
        "follow_velocity": actions.follow_velocity,
        "follow_acceleration": actions.follow_acceleration,
        "coulomb_compensation": per_joint(
            robot, "actions.coulomb_compensation", actions.coulomb_compensation
        ),
        "viscous_compensation": per_joint(
            robot, "actions.viscous_compensation", actions.viscous_compensation
        ),
        "compensation_width": actions.compensation_width,
    }


def _sensors(sensors: SensorSettings, robot: FlexibleJointRobot) -> dict[str, Array | float]:
    numbers: dict[str, Array | float] = {
        "link_resolution": sensors.link_resolution,
        "motor_resolution": sensors.motor_resolution,
        "velocity_differences": float(sensors.velocity == "differences"),
        "velocity_bandwidth": _pole(sensors.velocity_filter),
        "torque_bandwidth": _pole(sensors.torque_bandwidth),
        "wrench_bandwidth": _pole(sensors.wrench_bandwidth),
    }
    for name in ("torque_scale", "torque_offset", "link_offset", "motor_offset"):
        numbers[name] = per_joint(robot, f"sensors.{name}", getattr(sensors, name))
    return numbers


def _errors(
    control: Control, sensors: SensorSettings, noise: Noise | None, robot: FlexibleJointRobot
) -> dict[str, Array | float]:
    """Return how large the errors of the sensors are, which the law's books know; their signs they do not."""
    return {
        "torque_scale": np.abs(per_joint(robot, "sensors.torque_scale", sensors.torque_scale)),
        "torque_offset": np.abs(per_joint(robot, "sensors.torque_offset", sensors.torque_offset)),
        "torque_bandwidth": _pole(sensors.torque_bandwidth),
        "link_resolution": sensors.link_resolution,
        "noise_deviation": math.sqrt(noise.torque_variance) if noise else 0.0,
        "noise_hold": noise.hold if noise else 0.0,
        "noise_credit": 0.0,  # of the loop: see `noise_credit.charged`
        "bend": BEND,
        "period": 1 / control.rate,
        "link_deviation": noise.link_deviation if noise else 0.0,
        "noise_debit": 0.0,
        "jitter_mean": 0.0,  # of the loop as well: see `storage_jitter`
        "jitter_share": 0.0,
    }


def late_sensors(late: Lateness) -> dict[str, float]:
    """Return the numbers of sensors that are so many periods late."""
    return {f"{name}_late": periods for name, periods in late._asdict().items()}


def late_errors(late: Lateness) -> dict[str, float]:
    """Return what the books know of it."""
    return {"late": max(late.link, late.torque), "pairing": abs(late.torque - late.link)}


def _limits(motors: MotorSettings, robot: FlexibleJointRobot) -> dict[str, Array]:
    unlimited = np.full(robot.n, UNLIMITED_TORQUE)
    named = {"none": unlimited, "robot": robot.torque_limit}
    limit = (
        named[motors.torque_limit]
        if isinstance(motors.torque_limit, str)
        else per_joint(robot, "motors.torque_limit", motors.torque_limit)
    )
    rate = np.minimum(
        per_joint(robot, "motors.torque_rate_limit", motors.torque_rate_limit), UNLIMITED_TORQUE
    )
    return {"torque_limit": np.minimum(limit, UNLIMITED_TORQUE), "torque_rate_limit": rate}


def _gain_changes(scenario: Scenario, gains: dict[str, Array]) -> tuple[GainChange, ...]:
    law, changes = scenario.law, list[GainChange]()
    stiffness, damping = gains["stiffness"], gains["damping"]
    K_in, D_in = law.stiffness.in_tool, law.damping.in_tool
    if K_in or D_in:
        stiffness = law.stiffness.full() if K_in else stiffness
        damping = law.damping.full() if D_in else damping
        changes.append(GainChange(FROM_THE_START, FROM_THE_START, stiffness, damping, in_tool=(K_in, D_in)))
    begins = [*(event.at for event in scenario.reference[1:]), scenario.duration]
    for event, end in zip(scenario.reference, begins, strict=False):
        if not isinstance(event, Table):
            continue
        for row in event.gains(scenario.seed):
            if row.start >= end:
                break
            if row.stiffness is not None:
                stiffness, K_in = row.stiffness, event.in_tool
            if row.damping is not None:
                damping, D_in = row.damping, event.in_tool
            linear = event.between == "linear"
            changes.append(GainChange(row.start, row.end, stiffness, damping, linear, (K_in, D_in)))
    for change in scenario.gain_changes:
        if change.stiffness is not None:
            stiffness, K_in = change.stiffness.full(), change.stiffness.in_tool
        if change.damping is not None:
            damping, D_in = change.damping.full(), change.damping.in_tool
        end = change.at + change.duration
        changes.append(GainChange(change.at, end, stiffness, damping, in_tool=(K_in, D_in)))
    return tuple(changes)
