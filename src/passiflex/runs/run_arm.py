"""The arm and robot of a run: as its file describes them, or for an older file as its configuration does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache

import numpy as np
from pydantic import ValidationError

from passiflex.errors import PassiflexError
from passiflex.files import read_json
from passiflex.problems.problem import Problem
from passiflex.problems.resolution import resolve
from passiflex.robots.arm import SerialArm
from passiflex.robots.catalogue import catalogue, read_description
from passiflex.robots.chain import SerialChain, read_chain
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.robots.frames import world_frames
from passiflex.runs.run import JOINT_PARAMETERS, Run
from passiflex.scenarios.scenario import Scenario, Tool
from passiflex.texts.yaml_tree import RefusedText, Tree

NEAR = 1e-6
"""Share of the arm's reach by which its end effector may be off the recorded one."""


def chain_of(run: Run) -> SerialChain | None:
    """Return the arm with its tool, or None where the run does not say which one it was.

    A file with the attribute `robot_description` is asked first. An older one names a robot in its
    configuration: if that is one of the catalogue, it is taken, with the tool. An arm of another number of
    joints, or one whose end effector is not where the run recorded it, is not the arm of the run.
    """
    for chain in _candidates(run):
        if _fits(chain, run):
            return chain
    return None


def robot_of(run: Run) -> FlexibleJointRobot | None:
    """Return the robot as described, with its tool, from what the run's file itself holds; None where it does not.

    Raises
    ------
    PassiflexError
        If its joints have numbers that no robot has.
    """
    chain, found = chain_of(run), read_json(str(run.data.attrs.get("joint_parameters", "{}")))
    limits = ("torque_limit", "velocity_limit", "lower_position_limit", "upper_position_limit")
    if chain is None or not set(found) >= set(JOINT_PARAMETERS) or not set(limits) <= set(run.data):
        return None
    try:
        stiffness, damping, inertia = (np.array(found[name], dtype=float) for name in JOINT_PARAMETERS)
    except (TypeError, ValueError):
        return None
    return FlexibleJointRobot(
        name=chain.name,
        arm=SerialArm(chain),
        joint_stiffness=stiffness,
        joint_damping=damping,
        motor_inertia=inertia,
        torque_limit=run["torque_limit"],
        velocity_limit=run["velocity_limit"],
        position_limit=np.column_stack([run["lower_position_limit"], run["upper_position_limit"]]),
    )


def problem_of(run: Run, scenario: Scenario) -> Problem | None:
    """Return the problem of a run's scenario: its robot is one of the catalogue, or within the run's file.

    A file that the scenario names is not opened: whoever made the run may have named any.

    Raises
    ------
    PassiflexError
        If the scenario does not fit the robot.
    """
    if scenario.robot in catalogue():
        return resolve(scenario)
    robot = robot_of(run)
    return None if robot is None else resolve(scenario.model_copy(update={"tool": Tool()}), robot)


def _candidates(run: Run) -> Iterator[SerialChain]:
    """Yield what the file says about its arm, best first."""
    name, text = str(run.data.attrs.get("robot", "")), str(run.data.attrs.get("robot_description", ""))
    if "<" in text and "<!" not in text:  # anything else would be a path, or is none of ours
        with suppress(PassiflexError, ValueError, RecursionError):  # the catalogue may know the robot
            yield replace(_described(text), name=name or "arm")
    settings = _settings(str(run.data.attrs.get("scenario", "")))
    if settings is not None:
        robot, tool = settings
        yield read_description(robot).chain.with_tool(tool.position, tool.rotation_vector)


@lru_cache(maxsize=8)
def _described(text: str) -> SerialChain:
    """Return the arm of a description, which is asked for again and again."""
    return read_chain(text, base="base").chain


@lru_cache(maxsize=8)
def _settings(text: str) -> tuple[str, Tool] | None:
    """Return robot and tool of a run's configuration; None where that cannot be read, or names no robot of ours."""
    try:
        configuration = Tree().read(text, "a configuration names a robot")
        robot, tool = configuration["robot"], Tool.model_validate(configuration.get("tool", {}))
    except (RefusedText, ValidationError, KeyError):
        return None
    return (robot, tool) if robot in catalogue() else None


def _fits(chain: SerialChain, run: Run) -> bool:
    """Return whether the arm has the run's joints, and its end effector was there in the first good row."""
    if "q" not in run.data or run["q"].ndim != 2 or run["q"].shape[1] != chain.n:
        return False
    if "position" not in run.data:
        return True
    q, recorded = run["q"], run["position"]
    good = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(recorded).all(axis=1))
    if not good.size:
        return True
    there = world_frames(chain, q[good[:1]]).position[0, -1]
    reach = np.linalg.norm([j.xyz for j in chain.joints], axis=1).sum() + np.linalg.norm(chain.tip_xyz)
    return bool(np.abs(there - recorded[good[0]]).max() <= NEAR * max(reach, 1.0))
