"""The arm's expressions against Pinocchio, against closed forms, and against themselves."""

from __future__ import annotations

import casadi as cs
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arms import serial_chains
from passiflex.robots.arm import SerialArm
from passiflex.robots.catalogue import read_description
from passiflex.robots.chain import SerialChain

GRAVITY = (0.3, -0.4, -9.81)


def expressions(arm: SerialArm) -> cs.Function:
    q, dq = cs.SX.sym("q", arm.n), cs.SX.sym("dq", arm.n)
    vector, m = arm.layout.symbols("m")
    M, pose = arm.mass_matrix(q, m), arm.pose(q, m)
    return cs.Function(
        "arm",
        [q, dq, vector],
        [
            M,
            arm.coriolis_torque(q, dq, m),
            arm.gravity_torque(q, m),
            arm.potential_energy(q, m),
            pose.position,
            pose.rotation,
            arm.jacobian(q, m),
            cs.gradient(arm.potential_energy(q, m), q),
            arm.coriolis_matrix(q, dq, m),
            cs.reshape(cs.jtimes(cs.vec(M), q, dq), arm.n, arm.n),
            arm.kinetic_energy(q, dq, m),
        ],
        ["q", "dq", "m"],
        ["M", "Cdq", "g", "V", "p", "R", "J", "grad_V", "C", "dM", "E"],
    )


def evaluate(arm: SerialArm, q: np.ndarray, dq: np.ndarray) -> dict[str, np.ndarray]:
    result = expressions(arm).call({"q": q, "dq": dq, "m": arm.layout.pack(arm.nominal(GRAVITY))})
    return {k: np.array(v).squeeze() if k != "J" else np.array(v) for k, v in result.items()}


def close(ours: np.ndarray, theirs: np.ndarray) -> None:
    scale = max(1.0, float(np.abs(theirs).max(initial=0)))
    np.testing.assert_allclose(np.ravel(ours), np.ravel(theirs), rtol=0, atol=1e-12 * scale)


def check_against_pinocchio(chain: SerialChain, seed: int) -> None:
    arm, rng = SerialArm(chain), np.random.default_rng(seed)
    q, dq = rng.uniform(-2, 2, arm.n), rng.uniform(-2, 2, arm.n)
    ours = evaluate(arm, q, dq)
    model = pin.buildModelFromXML(chain.to_urdf())
    model.gravity.linear = np.array(GRAVITY)
    data = model.createData()
    frame = model.getFrameId("tip")
    M = pin.crba(model, data, q)
    close(ours["M"], np.triu(M) + np.triu(M, 1).T)
    close(ours["g"], pin.computeGeneralizedGravity(model, data, q))
    close(
        ours["Cdq"], pin.nonLinearEffects(model, data, q, dq) - pin.computeGeneralizedGravity(model, data, q)
    )
    close(ours["V"], np.array(pin.computePotentialEnergy(model, data, q)))
    close(ours["E"], np.array(pin.computeKineticEnergy(model, data, q, dq)))
    pin.framesForwardKinematics(model, data, q)
    close(ours["p"], data.oMf[frame].translation)
    close(ours["R"], data.oMf[frame].rotation)
    close(ours["J"], pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED))
    close(ours["grad_V"], ours["g"])
    close(ours["C"] @ np.atleast_1d(dq) if arm.n > 1 else ours["C"] * dq, ours["Cdq"])
    close(ours["dM"], ours["C"] + np.transpose(ours["C"]))


@settings(max_examples=60, deadline=None)
@given(serial_chains(1, 12), st.integers(0, 2**32 - 1))
def test_random_arms_agree_with_pinocchio(chain: SerialChain, seed: int) -> None:
    check_against_pinocchio(chain, seed)


@pytest.mark.parametrize("name", ["iiwa14", "iiwa14_stuerz"])
@pytest.mark.parametrize("seed", range(5))
def test_catalogue_agrees_with_pinocchio(name: str, seed: int) -> None:
    check_against_pinocchio(read_description(name).chain, seed)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
@settings(deadline=None, max_examples=20)
def test_planar_arm_has_its_closed_forms(q1: float, q2: float, w1: float, w2: float) -> None:
    """The textbook 2R arm in the x–z plane, angles lifting it from +x."""
    arm = SerialArm(read_description("planar2r").chain)
    b1, b2 = arm.chain.bodies
    l1 = float(np.linalg.norm(arm.chain.joints[1].xyz))
    l2 = float(np.linalg.norm(arm.chain.tip_xyz))
    c1, c2 = float(np.linalg.norm(b1.com)), float(np.linalg.norm(b2.com))
    I1, I2 = b1.inertia[3], b2.inertia[3]  # about y, the axis of both joints
    m1, m2 = b1.mass, b2.mass
    g = 9.81
    vector = arm.layout.pack(arm.nominal((0.0, 0.0, -g)))
    f = expressions(arm)
    out = {k: np.array(v) for k, v in f.call({"q": [q1, q2], "dq": [w1, w2], "m": vector}).items()}
    a, b, d = m1 * c1**2 + I1 + m2 * l1**2, m2 * c2**2 + I2, m2 * l1 * c2
    M = np.array([[a + b + 2 * d * np.cos(q2), b + d * np.cos(q2)], [b + d * np.cos(q2), b]])
    h = d * np.sin(q2)
    close(out["M"], M)
    close(out["Cdq"], np.array([-h * (2 * w1 * w2 + w2**2), h * w1**2]))
    close(out["V"], np.array(g * (m1 * c1 * np.sin(q1) + m2 * (l1 * np.sin(q1) + c2 * np.sin(q1 + q2)))))
    close(
        out["p"],
        np.array([l1 * np.cos(q1) + l2 * np.cos(q1 + q2), 0, l1 * np.sin(q1) + l2 * np.sin(q1 + q2)]),
    )
    J_z = [l1 * np.cos(q1) + l2 * np.cos(q1 + q2), l2 * np.cos(q1 + q2)]
    close(out["J"][2], np.array(J_z))
    close(out["g"][1], np.array(g * m2 * c2 * np.cos(q1 + q2)))


def test_tool_and_inertia_are_inputs() -> None:
    """A heavier last link and a longer tool need no other function."""
    arm = SerialArm(read_description("iiwa14").chain)
    numbers, f = arm.nominal(), expressions(arm)
    q, dq = np.full(7, 0.4), np.zeros(7)
    base = f.call({"q": q, "dq": dq, "m": arm.layout.pack(numbers)})
    doubled = numbers | {k: 2 * numbers[k] for k in ("link_mass", "link_moment", "link_inertia")}
    heavy = f.call({"q": q, "dq": dq, "m": arm.layout.pack(doubled)})
    close(np.array(heavy["M"]), 2 * np.array(base["M"]))
    longer = numbers | {"tool_position": numbers["tool_position"] + [0, 0, 0.2]}
    tool = f.call({"q": q, "dq": dq, "m": arm.layout.pack(longer)})
    close(np.array(tool["p"] - base["p"]), 0.2 * np.array(base["R"])[:, 2])
