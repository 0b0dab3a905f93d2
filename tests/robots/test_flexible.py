"""The flexible-joint robot refuses numbers that no joint has, and says which."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings

from arms import serial_chains
from passiflex.control import ImpedanceLaw
from passiflex.errors import SizeError, ValueRangeError
from passiflex.robots import FlexibleJointRobot, SerialArm, SerialChain
from passiflex.simulation import ClosedLoop


@pytest.mark.parametrize("name", ["joint_stiffness", "joint_damping", "motor_inertia"])
@pytest.mark.parametrize("wrong", [-1.0, 0.0, np.nan, np.inf])
def test_joint_data_are_positive(name: str, wrong: float) -> None:
    robot = FlexibleJointRobot.load("planar2r")
    with pytest.raises(
        ValueRangeError, match=f"{name} of robot 'planar2r'; got .*; needs positive numbers in "
    ):
        dataclasses.replace(robot, **{name: np.array([1.0, wrong])})
    with pytest.raises(SizeError, match=rf"{name} of robot 'planar2r'; got \(3,\); needs \(2,\) in "):
        dataclasses.replace(robot, **{name: np.ones(3)})


@settings(max_examples=15, deadline=None)
@given(serial_chains(1, 4))
def test_every_joint_quantity_has_the_units_of_its_joints(chain: SerialChain) -> None:
    n, robot = chain.n, FlexibleJointRobot.load("planar2r")
    ones = np.ones(n)
    arm = FlexibleJointRobot(
        "arm", SerialArm(chain), ones, ones, ones, ones, ones, np.outer(ones, [-1, 1]), robot.sources
    )
    kinds = {j.kind for j in chain.joints}
    state = {f.name: f.unit for f in ClosedLoop(ImpedanceLaw(arm)).state}
    assert ("rad" in state["q"]) == ("revolute" in kinds)
    assert ("m" in state["q"].split(" or ")) == ("prismatic" in kinds)
