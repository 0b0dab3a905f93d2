"""The arm of a run: as its file describes it, or for an older file as its configuration does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from pydantic import ValidationError

from passiflex.errors import PassiflexError
from passiflex.robots.catalogue import read_description
from passiflex.robots.chain import SerialChain, read_chain
from passiflex.robots.frames import world_frames
from passiflex.simulation.run import Run
from passiflex.simulation.scenario import Tool
from passiflex.texts.yaml_tree import RefusedText, Tree

NEAR = 1e-6
"""Share of the arm's reach by which its end effector may be off the recorded one."""


def chain_of(run: Run) -> SerialChain | None:
    """Return the arm with its tool, or None where the run does not say which one it was.

    A file with the attribute `robot_description` is asked first. An older one names a robot in its
    configuration: that one is taken, with the tool. An arm of another number of joints, or one whose
    end effector is not where the run recorded it, is not the arm of the run.
    """
    for chain in _candidates(run):
        if _fits(chain, run):
            return chain
    return None


def _candidates(run: Run) -> Iterator[SerialChain]:
    """Yield what the file says about its arm, best first."""
    name, text = str(run.data.attrs.get("robot", "")), str(run.data.attrs.get("robot_description", ""))
    if "<" in text:  # anything else would be read as the path of a file
        with suppress(PassiflexError):  # a damaged description: the catalogue may know the robot
            yield replace(read_chain(text).chain, name=name or "arm")
    settings = _settings(run)
    if settings is not None:
        robot, tool = settings
        try:
            chain = read_description(robot).chain
        except PassiflexError:
            return  # the robot's file is gone
        yield chain.with_tool(tool.position, tool.rotation_vector)


def _settings(run: Run) -> tuple[str, Tool] | None:
    """Return robot and tool of the run's configuration, None where that cannot be read."""
    try:
        configuration = Tree().read(
            str(run.data.attrs.get("configuration", "")), "a configuration names a robot"
        )
        return str(configuration["robot"]), Tool.model_validate(configuration.get("tool", {}))
    except (RefusedText, ValidationError, KeyError):
        return None


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
