"""A setting over the ranges of what is assumed: the same gains for all the robots that an arm may be."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from passiflex.cards.setting import Found, Scales, Setting
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]

ENTRIES = ("joint_stiffness", "joint_damping", "motor_inertia")
"""What a robot file may have to assume, and a card hangs on."""
BRIDGED = 1.5
"""Ratio of two stiffnesses that a margin of 20 % to either side leaves no gap between."""
LAST = 2
"""Robots whose boxes are searched."""
UNSAID = (0.5, 2.0)
"""Range of an entry that has none in its file."""


def uncertain(robot: FlexibleJointRobot) -> tuple[str, ...]:
    """Return the entries of a robot that are assumed, or have a range."""
    return tuple(entry for entry in ENTRIES if entry in robot.ranges or robot.assumed(entry))


def range_of(robot: FlexibleJointRobot, entry: str) -> tuple[float, float]:
    """Return the range of an entry, as multiples."""
    low, high = robot.ranges.get(entry, UNSAID)
    return low, high


def at_shares(setting: Setting, shares: Mapping[str, float]) -> Setting:
    """Return the setting of a robot whose entries are multiples of what its file has, asked of the same corners."""
    robot = setting.robot
    changed = {entry: share * getattr(robot, entry) for entry, share in shares.items()}
    return dataclasses.replace(
        setting, robot=dataclasses.replace(robot, **changed), _members=list(setting.members)
    )


def _spread(robot: FlexibleJointRobot) -> Iterator[tuple[tuple[str, float], ...]]:
    """Yield what to multiply the entries by that are assumed: all corners, and stiffnesses between them.

    A resonance meets the clock anywhere: so the stiffness goes in steps that its margin bridges, with the least
    damping that there may be.
    """
    ends = {entry: range_of(robot, entry) for entry in uncertain(robot)}
    low, high = ends.get(ENTRIES[0], (1.0, 1.0))
    steps = np.geomspace(low, high, 1 + math.ceil(math.log(high / low) / math.log(BRIDGED)))
    between = {ENTRIES[0]: tuple(steps.tolist()), ENTRIES[1]: ends.get(ENTRIES[1], (1.0,))[:1]}
    both = [ends, {entry: between.get(entry, values) for entry, values in ends.items()}]
    found = (
        itertools.product(*([(e, v) for v in values] for e, values in choice.items())) for choice in both
    )
    yield from dict.fromkeys(itertools.chain(*found))


@dataclass(frozen=True, eq=False)
class Spread:
    """Settings that the same gains are to hold for; the first one is the robot as its file has it."""

    settings: list[Setting]
    _asked: list[Setting] = field(default_factory=list)

    @classmethod
    def over(cls, setting: Setting) -> Spread:
        """Return a setting with those of the robot over the ranges of what is assumed."""
        shares = [dict(pairs) for pairs in _spread(setting.robot)]
        return cls([setting, *(at_shares(setting, entries) for entries in shares if entries)])

    @property
    def nominal(self) -> Setting:
        """Return the setting of the robot as its file has it."""
        return self.settings[0]

    @property
    def order(self) -> list[Scales]:
        """Return in which order dampings are tried."""
        return self.nominal.order

    @property
    def stiffest(self) -> dict[str, float]:
        """Return the K_x beyond which nothing is looked for: where the softest springs end."""
        found = [setting.stiffest for setting in self.settings]
        return {part: min(one[part] for one in found) for part in found[0]}

    def gains(self, translation: float, rotation: float, scales: Scales = (1.0, 1.0)) -> dict[str, Array]:
        """Return K_x and D_x by the robot as its file has it, as nobody knows another one."""
        return self.nominal.gains(translation, rotation, scales)

    def holds(
        self, gains: Mapping[str, Array], period: float | None = None, delay: float | None = None
    ) -> bool:
        """Return whether all hold, as those of `Setting`; the one that failed last is asked first."""
        self._asked[:] = self._asked or self.settings
        for i, setting in enumerate(self._asked):
            if not setting.holds(gains, period, delay):
                self._asked.insert(0, self._asked.pop(i))
                return False
        return True

    def searched(self, gains: Mapping[str, Array], *, thorough: bool = False) -> bool:
        """Return whether nothing that fails is found in the boxes of those robots that die out last."""
        last = sorted(self.settings, key=lambda s: -s.worst(gains).radius)[:LAST]
        return all(setting.searched(gains, thorough=thorough) for setting in last)

    def worst(self, gains: Mapping[str, Array]) -> Found:
        """Return what dies out last."""
        return max((setting.worst(gains) for setting in self.settings), key=lambda found: found.radius)
