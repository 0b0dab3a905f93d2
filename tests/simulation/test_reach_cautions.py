"""A reference that no posture can follow is said before the run, and no other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arms import serial_chains
from passiflex.robots.chain import SerialChain
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.frames import world_frames
from passiflex.simulation import load_scenario, resolve
from passiflex.simulation.reach_cautions import longest, out_of_reach
from worlds import world

SHIPPED = Path(__file__).parents[2]


def told(*reference: dict[str, Any]) -> tuple[str, ...]:
    return out_of_reach(resolve(world(reference=list(reference))))


def step(*by: float) -> dict[str, Any]:
    return {"at": 0.01, "kind": "step", "by": list(by)}


@given(serial_chains(min_joints=1, max_joints=7), st.integers(0, 2**32 - 1))
def test_no_end_effector_is_further_than_the_arm_is_long(chain: SerialChain, seed: int) -> None:
    still, length = longest(chain)
    low, high = (
        np.array([np.clip(getattr(j, end), -10, 10) for j in chain.joints]) for end in ("lower", "upper")
    )
    q = np.random.default_rng(seed).uniform(low, high, (200, chain.n))
    away = np.linalg.norm(world_frames(chain, q).position[:, -1] - still, axis=1)
    assert away.max() <= length + 1e-9


def test_the_length_of_an_arm_is_that_of_its_links_in_one_line() -> None:
    still, length = longest(FlexibleJointRobot.load("iiwa14").arm.chain)
    np.testing.assert_allclose(still, [0, 0, 0.36], atol=1e-12)
    assert length == pytest.approx(0.42 + 0.4 + 0.126, abs=3e-3)


def test_a_reference_beyond_the_arm_is_said() -> None:
    (far,) = told(step(0.1, 0, 2))
    assert far.startswith("at 0.01 s the reference is ")
    assert "and the arm is at most 0.9 m long" in far
    assert told(step(0.01, 0, 0.01)) == ()


def test_a_reference_off_the_plane_of_a_planar_arm_is_said_with_its_energy() -> None:
    (off,) = told(step(0, 0.05, 0))
    K = resolve(world()).gains
    stiffness = resolve(world()).law.layout.unpack(K)["stiffness"][1, 1]
    assert "0.05 m along [0 1 0]" in off.replace("[0 -1 0]", "[0 1 0]")
    assert f"{stiffness * 0.05**2 / 2:.3g} J stay in the spring" in off
    circle = {"at": 0.01, "kind": "circle", "plane": ["x", "y"], "radius": 0.02, "period": 0.02}
    assert len(told(circle)) == 1


@pytest.mark.parametrize(
    "path", sorted(SHIPPED.glob("src/passiflex/studies/scenarios/*.yaml")), ids=lambda p: p.stem
)
def test_nothing_is_said_of_what_an_arm_can_follow(path: Path) -> None:
    assert out_of_reach(resolve(load_scenario(path))) == ()
