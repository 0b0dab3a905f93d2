"""Frames of the bodies, against pinocchio, against the arm's own expressions, and against recorded motion."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arms import serial_chains
from passiflex.errors import SizeError
from passiflex.robots import SerialChain
from passiflex.robots.catalogue import read_description
from passiflex.robots.frames import relative_frames, world_frames


@settings(max_examples=40, deadline=None)
@given(chain=serial_chains(), seed=st.integers(0, 2**32 - 1))
def test_every_frame_is_where_pinocchio_has_it(chain: SerialChain, seed: int) -> None:
    model = pin.buildModelFromXML(chain.to_urdf())
    data = model.createData()
    q = np.random.default_rng(seed).uniform(-3, 3, (3, chain.n))
    frames = world_frames(chain, q)
    for row in range(3):
        pin.framesForwardKinematics(model, data, q[row])
        for i, name in enumerate(["base", *(f"link_{k + 1}" for k in range(chain.n)), "tip"]):
            pose = data.oMf[model.getFrameId(name)]
            np.testing.assert_allclose(frames.position[row, i], pose.translation, atol=1e-12)
            np.testing.assert_allclose(frames.rotation[row, i], pose.rotation, atol=1e-12)


@pytest.mark.parametrize("name", ["iiwa14", "planar2r"])
def test_relative_frames_make_up_the_world_frames(name: str) -> None:
    chain = read_description(name).chain
    q = np.random.default_rng(0).uniform(-2, 2, (5, chain.n))
    relative, world = relative_frames(chain, q), world_frames(chain, q)
    for row in range(5):
        T = np.eye(4)
        for i in range(chain.n + 2):
            step = np.eye(4)
            step[:3, :3], step[:3, 3] = relative.rotation[row, i], relative.position[row, i]
            T = T @ step
            np.testing.assert_allclose(T[:3, 3], world.position[row, i], atol=1e-14)
            np.testing.assert_allclose(T[:3, :3], world.rotation[row, i], atol=1e-14)


def test_a_number_that_is_missing_leaves_the_bodies_before_it_where_they_are() -> None:
    chain = read_description("iiwa14").chain
    q = np.zeros((1, 7))
    q[0, 3] = np.nan
    position, rotation = world_frames(chain, q)
    assert np.isfinite(position[0, :5]).all()  # the origin of joint 4 does not depend on its angle
    assert np.isfinite(rotation[0, :4]).all()
    assert np.isnan(position[0, -1]).any()


@pytest.mark.parametrize("shape", [(2,), (4, 3)])
def test_positions_of_another_arm_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(SizeError, match=r"do not fit the arm; got \(.*\); needs \(N, 2\) in rad or m"):
        world_frames(read_description("planar2r").chain, np.zeros(shape))
