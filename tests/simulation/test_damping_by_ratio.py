"""Damping by ratio against the eigenvalues of links, joint springs, shaped motors and gains, built with pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import yaml

from passiflex.robots.catalogue import read_description
from passiflex.simulation import parse_scenario, resolve

POSTURE = np.radians([0, 35, 0, -70, 0, 55, 0])
LAW = {
    "type": "impedance",
    "task": "pose",
    "gravity": "robot",
    "shaped_stiffness": {"ratio": 1},
    "stiffness": {"translation": 400, "rotation": 30},
    "null_space_damping": 5,
}


def modes(shaped_inertia: float, ratio: float) -> np.ndarray:
    """Return the damping ratios of the six slowest vibrations of q and φ together, whatever the package thinks of them.

    M q̈ = K (φ − q) + D (φ̇ − q̇),  B_e φ̈ = −K (φ − q) − D (φ̇ − q̇) − Jᵀ K_x J φ − (Jᵀ D_x J + D_ns) φ̇
    """
    law = LAW | {"shaped_inertia": {"ratio": shaped_inertia}, "damping": {"ratio": ratio}}
    data = {"name": "ratio", "robot": "iiwa14", "posture": POSTURE.tolist(), "law": law, "duration": 1}
    p = resolve(parse_scenario(yaml.safe_dump(data)))
    g, m = p.law.layout.unpack(p.gains), p.law.robot.layout.unpack(p.plant)

    model = pin.buildModelFromXML(read_description("iiwa14").chain.to_urdf())
    at = model.createData()
    M = pin.crba(model, at, POSTURE)
    M = np.triu(M) + np.triu(M, 1).T
    pin.framesForwardKinematics(model, at, POSTURE)
    J = pin.computeFrameJacobian(model, at, POSTURE, model.nframes - 1, pin.LOCAL_WORLD_ALIGNED)
    R = at.oMf[model.nframes - 1].rotation
    K_x = g["stiffness"].copy()
    K_x[3:, 3:] = R @ K_x[3:, 3:] @ R.T
    D_ns = 5 * (M - J.T @ np.linalg.solve(J @ np.linalg.solve(M, J.T), J))

    n, zero = 7, np.zeros((7, 7))
    K, D, B_e = np.diag(m["joint_stiffness"]), np.diag(m["joint_damping"]), np.diag(g["shaped_inertia"])
    inertia = np.block([[M, zero], [zero, B_e]])
    stiffness = np.block([[K, -K], [-K, K + J.T @ K_x @ J]])
    damping = np.block([[D, -D], [-D, D + J.T @ g["damping"] @ J + D_ns]])
    A = np.block(
        [
            [np.zeros((2 * n, 2 * n)), np.eye(2 * n)],
            [-np.linalg.solve(inertia, stiffness), -np.linalg.solve(inertia, damping)],
        ]
    )
    poles = np.linalg.eigvals(A)
    vibrations = poles[poles.imag > 1e-3]
    slowest = vibrations[np.argsort(np.abs(vibrations))][:6]
    return -slowest.real / np.abs(slowest)


@pytest.mark.parametrize("shaped_inertia", [0.01, 0.03, 0.1, 0.3, 1.0])
def test_every_mode_has_the_ratio_whatever_the_motors(shaped_inertia: float) -> None:
    """0.7 within 0.06, the compliance of the joints: they are in the model, and not in the design."""
    np.testing.assert_allclose(modes(shaped_inertia, 0.7), 0.7, rtol=0, atol=0.06)
