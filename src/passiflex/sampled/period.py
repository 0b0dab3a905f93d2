"""What one control period passes from step to step: what was read, what settled, what is in force, what was granted."""

from __future__ import annotations

from typing import NamedTuple

import casadi as cs

from passiflex.control.law import Gains, Stored
from passiflex.control.signals import Measurement
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


class Granted(NamedTuple):
    """The reference and stiffness in force, with what they cost."""

    pose: EndEffectorPose
    stiffness: cs.SX
    pose_share: cs.SX
    stiffness_share: cs.SX
    cost: cs.SX
    entry: TankEntry
