"""The arm on a page is the arm of the run: kinematics, kinds of joints, and whose arm is drawn at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from arms import serial_chains
from passiflex.reports.arm import arm_header
from passiflex.robots import SerialChain
from passiflex.robots.frames import world_frames
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run, parse_scenario, simulate
from reports.pages import PLANAR, baseline, changed, continuous, page


def test_the_arm_puts_the_end_effector_where_the_run_has_it() -> None:
    run, read = continuous(), page(continuous())
    tip = forward(read.header["arm"], read.array(read.header["frames"]["q"]))
    np.testing.assert_allclose(tip, run["position"], atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(serial_chains(1, 6), st.integers(0, 2**32 - 1))
def test_any_arm_can_be_drawn_from_its_header(chain: SerialChain, seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-2, 2, (4, chain.n))
    arm = arm_header(chain)
    assert len(arm["solids"]) == chain.n + 1
    np.testing.assert_allclose(forward(arm, q), world_frames(chain, q).position[:, -1], atol=1e-9)


def forward(arm: dict, q: np.ndarray) -> np.ndarray:
    """Return the end effector (N, 3) by the words of the format: each frame in that of the body before it."""
    out = []
    for row in q:
        p, R = np.zeros(3), np.eye(3)
        for joint, angle in zip(arm["joints"], row, strict=True):
            axis = np.array(joint["axis"])
            p, R = p + R @ joint["xyz"], R @ np.reshape(joint["rotation"], (3, 3))
            if joint["kind"] == "prismatic":
                p = p + R @ axis * angle
            else:
                K = np.cross(np.eye(3), axis)  # K v = axis × v
                R = R @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
        out.append(p + R @ arm["tip"]["xyz"])
    return np.array(out)


def test_another_arm_is_a_path_without_an_arm() -> None:
    longer = simulate(parse_scenario(PLANAR + "tool: {position: [0.1, 0, 0]}\n"))
    others = (longer, baseline(), continuous())
    header = page(continuous(), others).header
    assert [ghost["q"] is None for ghost in header["ghosts"]] == [True, True, False]
    assert header["notices"] == [
        f"{label} is shown without its arm: it is another arm, or its file does not say its kinematics."
        for label in ("planar (2)", "baseline")
    ]


def sliding() -> Run:
    """Return a run that says to be of an arm whose second joint slides."""
    chain = chain_of(continuous())
    assert chain is not None
    first, second = chain.joints
    arm = replace(chain, joints=(first, second._replace(kind="prismatic")))
    moved = continuous().data.copy(deep=True)
    frames = world_frames(arm, continuous()["q"])
    moved["position"][:], moved["rotation"][:] = frames.position[:, -1], frames.rotation[:, -1]
    return changed(Run(moved), robot_description=arm.to_urdf())


def test_a_joint_that_slides() -> None:
    arm = page(sliding()).header["arm"]
    assert [joint["kind"] for joint in arm["joints"]] == ["revolute", "prismatic"]
