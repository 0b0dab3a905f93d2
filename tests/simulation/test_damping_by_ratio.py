"""Damping by ratio against the eigenvalues of links, joint springs, shaped motors and gains, built with pinocchio."""

from __future__ import annotations

from typing import Any

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


def modes(ratio: float, posture: np.ndarray = POSTURE, **law: Any) -> np.ndarray:
    """Return the damping ratios of the six slowest vibrations of q and φ together, whatever the package thinks of them.

    M q̈ = K_e (φ − q) + D_e (φ̇ − q̇),  B_e φ̈ = −K_e (φ − q) − D_e (φ̇ − q̇) − Jᵀ K_x J φ − (Jᵀ D_x J + D_ns) φ̇
    """
    law = LAW | {"damping": {"ratio": ratio}} | law
    data = {"name": "ratio", "robot": "iiwa14", "posture": posture.tolist(), "law": law, "duration": 1}
    p = resolve(parse_scenario(yaml.safe_dump(data)))
    g, m = p.law.layout.unpack(p.gains), p.law.robot.layout.unpack(p.plant)

    model = pin.buildModelFromXML(read_description("iiwa14").chain.to_urdf())
    at = model.createData()
    M = pin.crba(model, at, posture)
    M = np.triu(M) + np.triu(M, 1).T
    pin.framesForwardKinematics(model, at, posture)
    J = pin.computeFrameJacobian(model, at, posture, model.nframes - 1, pin.LOCAL_WORLD_ALIGNED)
    R = at.oMf[model.nframes - 1].rotation
    K_x = g["stiffness"].copy()
    K_x[3:, 3:] = R @ K_x[3:, 3:] @ R.T
    D_ns = g["null_space_damping"] * (M - J.T @ np.linalg.solve(J @ np.linalg.solve(M, J.T), J))

    n, zero = 7, np.zeros((7, 7))
    K, B_e = np.diag(g["shaped_stiffness"]), np.diag(g["shaped_inertia"])
    D = np.diag(m["joint_damping"] * g["shaped_stiffness"] / m["joint_stiffness"])
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
@pytest.mark.parametrize("ratio", [0.3, 0.7, 0.9])
def test_every_mode_has_the_ratio_whatever_the_motors(shaped_inertia: float, ratio: float) -> None:
    found = modes(ratio, shaped_inertia={"ratio": shaped_inertia})
    np.testing.assert_allclose(found, ratio, rtol=0, atol=0.0101)


def case(rng: np.random.Generator) -> dict[str, Any] | None:
    """Return a posture and a law; None near a singularity, where the task's inertia has no measure."""
    low, high = np.radians([170, 120, 170, 120, 170, 120, 175]) * np.array([[-0.9], [0.9]])
    posture = rng.uniform(low, high)
    model = pin.buildModelFromXML(read_description("iiwa14").chain.to_urdf())
    at = model.createData()
    if np.linalg.cond(pin.computeFrameJacobian(model, at, posture, model.nframes - 1)) > 30:
        return None
    return {
        "posture": posture,
        "shaped_inertia": {"ratio": float(np.exp(rng.uniform(np.log(0.01), 0)))},
        "shaped_stiffness": {"ratio": float(rng.choice([1, rng.uniform(0.8, 2)]))},
        "stiffness": {"translation": float(rng.uniform(100, 1500)), "rotation": float(rng.uniform(10, 100))},
        "null_space_damping": float(rng.choice([0, rng.uniform(1, 10)])),
    }


def off_at_random(count: int, seed: int) -> np.ndarray:
    """Return how far the worst mode is from a wanted 0.7, for so many random cases."""
    rng = np.random.default_rng(seed)
    found = [modes(0.7, **c) for c in (case(rng) for _ in range(count)) if c is not None]
    return np.array([np.abs(z - 0.7).max() if z.size == 6 else np.inf for z in found])


def test_so_it_is_anywhere_and_for_any_gains() -> None:
    """The rigid design alone has 22 % of these beyond 0.06, and up to 0.27."""
    off = off_at_random(40, seed=5)
    assert off.size > 20
    assert off.max() < 0.06
