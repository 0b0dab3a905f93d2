"""From the settings of a law to its gains: ratios become numbers, for the law's own model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from passiflex.control.damping_design import ElasticArm, damping_from_ratio, damping_of_elastic
from passiflex.control.inner_loop import shaped_damping
from passiflex.control.law import AbstractLaw
from passiflex.control.tank import NO_CAP
from passiflex.control.task import AbstractTask
from passiflex.errors import SizeError
from passiflex.problems.posture import Posture, held_jacobian
from passiflex.problems.problem import TankStart
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.scenarios.law_settings import ImpedanceSettings, ShapedInertia, ShapedStiffness
from passiflex.scenarios.scenario import Scenario

Array = NDArray[np.float64]


def law_gains(
    scenario: Scenario, law: AbstractLaw, model: dict[str, Array], start: Posture
) -> dict[str, Array]:
    """Return the numbers of `law.layout`, with the law's model and the start posture as that model sees it."""
    s, robot = scenario.law, law.robot
    stiffness = s.stiffness.full()
    world = in_world(stiffness, start.pose.rotation)
    gains: dict[str, Array] = {
        "stiffness": stiffness,
        "null_space_damping": np.asarray(s.null_space_damping),
        "regularisation": np.asarray(s.regularisation),
    }
    if isinstance(s, ImpedanceSettings):
        gains["shaped_stiffness"] = sized(
            "law.shaped_stiffness", s.shaped_stiffness, model["joint_stiffness"], robot
        )
        gains["shaped_inertia"] = sized("law.shaped_inertia", s.shaped_inertia, model["motor_inertia"], robot)
        gains["damping"] = (
            s.damping.full()
            if s.damping.ratio is None
            else _designed(law.task, gains, start, model, s.damping.ratio)
        )
        return gains
    carried = model["motor_inertia"] if s.motor_inertia == "carried" else np.zeros(robot.n)
    if s.target_inertia.damping_ratio is not None:
        target = target_inertia(world, s.damping.full(), s.target_inertia.damping_ratio)
    else:
        target = s.target_inertia.full()
    return gains | {
        "target_inertia": target,
        "damping": s.damping.full()
        if s.damping.ratio is None
        else damping_from_ratio(world, target, s.damping.ratio),
        "carried_inertia": carried,
    }


def in_world(stiffness: Array, rotation: Array) -> Array:
    """Return K_x with its rotational block, which is in the axes of the reference, turned into world axes."""
    turn = np.eye(len(stiffness))
    if len(stiffness) == 6:
        turn[3:, 3:] = rotation
    return _symmetric(turn @ stiffness @ turn.T)


def target_inertia(stiffness: Array, damping: Array, ratio: float) -> Array:
    """Return M_x = D K⁻¹ D / (4 ζ²), for which D is the damping ratio ζ in every mode (theory note 2.8).

    For one axis it is m = (D / 2ζ)² / K.
    """
    return _symmetric(damping @ np.linalg.solve(stiffness, damping) / (4 * ratio**2))


def sized(
    name: str, setting: ShapedStiffness | ShapedInertia, own: Array, robot: FlexibleJointRobot
) -> Array:
    """Return the values (n,) of a setting.

    Raises
    ------
    SizeError
        If they do not fit the robot's joints.
    """
    try:
        return setting.resolve(own)
    except ValueError as error:
        raise SizeError(
            f"{name} does not fit robot {robot.name!r}",
            got=f"{np.size(setting.value or setting.ratio or ())} numbers",
            needs=f"one number or {robot.n}",
        ) from error


def _designed(
    task: AbstractTask, gains: dict[str, Array], start: Posture, model: dict[str, Array], ratio: float
) -> Array:
    """Return the D_x (k, k) with which every mode of the directions that are held has a damping ratio.

    The inertia is that of all that moves, links and motors as the law shapes them: (J (M + B_e)⁻¹ Jᵀ + ε I)⁻¹.
    """
    J, M, stiffness, motors = (
        held_jacobian(task, start),
        start.mass_matrix,
        gains["stiffness"],
        gains["shaped_inertia"],
    )

    def felt(moving: Array) -> Array:
        mobility = J @ np.linalg.solve(moving, J.T) + gains["regularisation"] * np.eye(len(J))
        return _symmetric(np.linalg.inv(mobility).astype(np.float64))

    K, K_e = model["joint_stiffness"], gains["shaped_stiffness"]
    still = gains["null_space_damping"] * (M - J.T @ felt(M) @ J)
    arm = ElasticArm(M, still, motors, K_e, np.asarray(shaped_damping(K, model["joint_damping"], K_e)), J)
    axes = np.ix_(task.held, task.held)
    damping = np.zeros_like(stiffness)
    held = stiffness if task.turned else in_world(stiffness, start.pose.rotation)
    damping[axes] = damping_of_elastic(held[axes], felt(M + np.diag(motors)), ratio, arm)
    return damping


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2


def tank_start(scenario: Scenario) -> TankStart:
    """Return the tank at the start; an empty one for a law without a tank."""
    t = scenario.tank
    return TankStart(t.initial, t.floor, t.cap, t.signed) if t else TankStart(0, 0, 0, False)


def tank_gains(scenario: Scenario) -> dict[str, float]:
    """Return the numbers of `EnergyTank.layout`."""
    t = scenario.tank
    values = (
        {
            "fill": t.fill,
            "floor": t.floor,
            "low": t.low,
            "cap": min(t.cap, NO_CAP),
            "band": t.band,
            "signed": t.signed,
        }
        if t
        else {"fill": 0, "floor": 0, "low": 1, "cap": NO_CAP, "band": 1, "signed": 0}
    )
    return {f"tank_{name}": float(value) for name, value in values.items()}
