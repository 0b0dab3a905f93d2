"""Arms of any number of joints: links one after another along x, each lighter than the one before."""

from __future__ import annotations

import numpy as np

from passiflex.robots import FlexibleJointRobot
from passiflex.robots.arm import SerialArm
from passiflex.robots.chain import Body, Joint, SerialChain

TURNS = {"x": np.array([1.0, 0, 0]), "y": np.array([0.0, 1, 0]), "z": np.array([0.0, 0, 1])}


def ladder(axes: str, *, length: float = 0.3, lighter: float = 0.75) -> FlexibleJointRobot:
    """Return an arm whose joints turn about these axes, as "zyyxyx"; K, D, B and the limits shrink with the links."""
    n, shares = len(axes), lighter ** np.arange(len(axes))
    joints = tuple(
        Joint(
            f"j{i}",
            "revolute",
            np.array([length * (i > 0), 0, 0]),
            np.zeros(3),
            TURNS[a],
            -2.5,
            2.5,
            2.0,
            80.0,
        )
        for i, a in enumerate(axes)
    )
    bodies = tuple(
        Body(4 * s, np.array([length / 2, 0, 0]), s * np.array([0.02, 0, 0, 0.04, 0, 0.04])) for s in shares
    )
    chain = SerialChain(f"ladder_{axes}", joints, bodies, np.array([length, 0, 0]), np.eye(3))
    return FlexibleJointRobot(
        name=chain.name,
        arm=SerialArm(chain),
        joint_stiffness=8000 * shares,
        joint_damping=3 * np.ones(n),
        motor_inertia=1.5 * shares,
        torque_limit=150 * shares,
        velocity_limit=np.full(n, 2.0),
        position_limit=np.tile([-2.5, 2.5], (n, 1)),
    )
