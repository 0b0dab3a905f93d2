"""The plant (2) against MuJoCo, an independent simulator, under the same torques and pushes."""

from __future__ import annotations

import casadi as cs
import mujoco
import numpy as np
from numpy.typing import NDArray

from passiflex.control.posture import posture
from passiflex.native import FixedStep
from passiflex.robots.chain import SerialChain, rotation_of
from passiflex.robots.flexible import FlexibleJointRobot, RobotState

HOLD = 5e-4
"""Torques are held this long in both simulators, so that both solve the same problem exactly."""
STEPS = 10
"""Runge-Kutta 4 steps per hold, the same in both: then they differ by round-off only, which a second of smooth
motion amplifies by a few hundred, and not by the method."""
DURATION = 1.0
START = np.array([0.1, 0.6, -0.2, -1.2, 0.3, 1.0, 0.2])


def quaternion(R: NDArray[np.float64]) -> str:
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(R).ravel())
    return numbers(q)


def numbers(values: NDArray[np.float64]) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def mjcf(chain: SerialChain, K: NDArray, D: NDArray, B: NDArray) -> str:
    """Return the flexible robot: one hinge per link, one per motor, one sprung and damped tendon between them.

    A motor is a balanced rotor of inertia B, half of it in its body and half of it as armature.
    """
    out = [
        '<mujoco><compiler angle="radian" autolimits="false" inertiafromgeom="false" balanceinertia="false"/>',
        f'<option integrator="RK4" timestep="{HOLD / STEPS!r}" gravity="0 0 -9.81">',
        '<flag contact="disable" constraint="disable" autoreset="disable"/></option><worldbody><site name="world"/>',
    ]
    for i, b in enumerate(B.tolist(), start=1):
        out.append(
            f'<body name="rotor_{i}" pos="{i} 0 5"><joint name="motor_{i}" axis="0 0 1" armature="{b / 2!r}"/>'
            f'<inertial pos="0 0 0" mass="1" diaginertia="{b / 2!r} {b / 2!r} {b / 2!r}"/></body>'
        )
    for i, (joint, body) in enumerate(zip(chain.joints, chain.bodies, strict=True), start=1):
        xx, xy, xz, yy, yz, zz = body.inertia
        out.append(
            f'<body name="link_{i}" pos="{numbers(joint.xyz)}" quat="{quaternion(rotation_of(joint.rpy))}">'
            f'<inertial pos="{numbers(body.com)}" mass="{body.mass!r}"'
            f' fullinertia="{numbers(np.array([xx, yy, zz, xy, xz, yz]))}"/>'
            f'<joint name="joint_{i}" type="hinge" axis="{numbers(joint.axis)}"/>'
        )
    out.append(
        f'<site name="tip" pos="{numbers(chain.tip_xyz)}"/>' + "</body>" * chain.n + "</worldbody><tendon>"
    )
    for i, (k, d) in enumerate(zip(K.tolist(), D.tolist(), strict=True), start=1):
        out.append(
            f'<fixed name="spring_{i}" stiffness="{k!r} 0 0" damping="{d!r} 0 0" springlength="0">'
            f'<joint joint="motor_{i}" coef="1"/><joint joint="joint_{i}" coef="-1"/></fixed>'
        )
    out.append("</tendon><actuator>")
    out += [f'<motor name="torque_{i}" joint="motor_{i}"/>' for i in range(1, chain.n + 1)]
    for axis in np.eye(6):
        out.append(f'<general site="tip" refsite="world" gear="{numbers(axis)}"/>')
    return "\n".join([*out, "</actuator></mujoco>"])


def in_mujoco(
    robot: FlexibleJointRobot, theta: NDArray[np.float64], held: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (q, θ) after each period of the held (τ_m, F_e); the run is refused if MuJoCo warns."""
    text = mjcf(robot.arm.chain, robot.joint_stiffness, robot.joint_damping, robot.motor_inertia)
    model = mujoco.MjModel.from_xml_string(text)
    data, n = mujoco.MjData(model), robot.n
    assert (model.nq, model.nv, model.nu) == (2 * n, 2 * n, n + 6)
    links = [model.joint(f"joint_{i}").qposadr[0] for i in range(1, n + 1)]
    motors = [model.joint(f"motor_{i}").qposadr[0] for i in range(1, n + 1)]
    data.qpos[links], data.qpos[motors] = START, theta
    rows = [np.concatenate([data.qpos[links], data.qpos[motors]])]
    for row in held:
        data.ctrl[:] = row
        mujoco.mj_step(model, data, STEPS)
        rows.append(np.concatenate([data.qpos[links], data.qpos[motors]]))
    assert sum(w.number for w in data.warning) == 0
    np.testing.assert_allclose(data.time, len(held) * HOLD, rtol=1e-9)
    return np.array(rows)


def in_passiflex(
    robot: FlexibleJointRobot, theta: NDArray[np.float64], held: NDArray[np.float64], steps: int
) -> NDArray[np.float64]:
    """Return (q, θ) after each period of the held (τ_m, F_e)."""
    n = robot.n
    x, u, (p, m) = cs.SX.sym("x", 4 * n), cs.SX.sym("u", n + 6), robot.layout.symbols("p")
    state = RobotState(*cs.vertsplit(x, n))
    tau_e = robot.arm.jacobian(state.q, m).T @ u[n:]
    a = robot.acceleration(state, u[:n], tau_e, m)
    dx = cs.densify(cs.vertcat(state.dq, state.dtheta, a.ddq, a.ddtheta))
    stepper = FixedStep(cs.Function("plant", [x, u, p], [dx, cs.SX(0, 1)], {"cse": True}))
    x0 = np.concatenate([START, theta, np.zeros(2 * n)])
    result = stepper.advance(x0, [], held, robot.layout.pack(robot.nominal()), HOLD, steps)
    assert result.completed == len(held)
    return result.states[:, : 2 * n]


def test_plant_is_that_of_mujoco() -> None:
    """A second of swinging iiwa 14 with gravity, and a push on the end effector in its second half.

    Step for step the two agree to 1e-10 rad, and the steps are short enough for 1e-6 rad: half of them in
    length change nothing beyond that.
    """
    robot = FlexibleJointRobot.load("iiwa14")
    weight = posture(robot, START, robot.nominal()).gravity_torque
    theta = START + weight / robot.joint_stiffness
    time = np.arange(round(DURATION / HOLD)) * HOLD
    frequency = np.array([3.0, 4, 5, 6, 7, 8, 9])
    amplitude = np.array([20.0, 25, 15, 12, 6, 4, 2])
    tau_m = weight + amplitude * np.sin(frequency * time[:, None]) * (1 - 0.3 * np.cos(2 * time[:, None]))
    push = np.where(time[:, None] >= DURATION / 2, [4.0, -6.0, 3.0, 0.5, -0.4, 0.3], 0.0)
    held = np.hstack([tau_m, push])
    ours, theirs = in_passiflex(robot, theta, held, STEPS), in_mujoco(robot, theta, held)
    moved = np.abs(ours - ours[0]).max(axis=0)
    assert (moved > 0.05).all()
    assert np.abs(ours[:, :7] - ours[:, 7:]).max() > 1e-3  # the springs are in play
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10)
    np.testing.assert_allclose(in_passiflex(robot, theta, held, 2 * STEPS), theirs, rtol=0, atol=1e-6)
