"""What one control period passes from step to step: what was read, what settled, what is in force, what was granted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs

from passiflex.control.law import Gains, Stored
from passiflex.control.signals import Command, Measurement
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.measurement_bound import Bound
from passiflex.sampled.readings import Paired
from passiflex.sampled.tank import TankEntry


class Read(NamedTuple):
    """The measurement as the law believes it and as the books pair it, the time since the last, memory, and doubt."""

    y: Measurement
    elapsed: cs.SX
    first: cs.SX
    observed: cs.SX
    seen: cs.SX
    paired: Paired
    bound: Bound


class Settled(NamedTuple):
    """The tank after the period before, w of that period, S at the reference then, which is `held`; and its jitter."""

    tank: TankEntry
    work: cs.SX
    storage: cs.SX
    held: EndEffectorPose
    jitter: cs.SX


class Force(NamedTuple):
    """What is in force after settling: the law's gains or the fallback's, the reference held, and the books."""

    now: Stored
    gains: Gains
    latched: cs.SX
    held: EndEffectorPose
    held_stiffness: cs.SX
    storage: cs.SX
    rebased: cs.SX
    tank: TankEntry
    lowest: cs.SX
    work: cs.SX
    doubt: cs.SX
    jitter: cs.SX


class Commanded(NamedTuple):
    """The command, how far the valve is open, and what is remembered of it.

    Attributes
    ----------
    compensation: Its part against friction (n,) N m.
    """

    command: Command
    valve: cs.SX
    compensation: cs.SX
    memory: cs.SX


class Granted(NamedTuple):
    """The reference and stiffness in force, with what they cost."""

    pose: EndEffectorPose
    stiffness: cs.SX
    pose_share: cs.SX
    stiffness_share: cs.SX
    cost: cs.SX
    entry: TankEntry


def chosen(flag: cs.SX, then: Gains, other: Gains) -> Gains:
    """Return the gains `then` if the flag is 1, else the others."""
    return SimpleNamespace(**{k: cs.if_else(flag, v, getattr(other, k)) for k, v in vars(then).items()})


def chosen_pose(flag: cs.SX, then: EndEffectorPose, other: EndEffectorPose) -> EndEffectorPose:
    """Return the pose `then` if the flag is 1, else the other."""
    return EndEffectorPose(
        cs.if_else(flag, then.position, other.position), cs.if_else(flag, then.rotation, other.rotation)
    )
