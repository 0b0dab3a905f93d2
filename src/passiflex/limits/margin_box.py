"""A margin, as a box of robots: all that may be off, off by that much at once; does the law hold on all?

A box is worst at a corner, and one quantity at a time misses corners. So all 2⁵ corners that are common to all
joints are tried, those to which the slopes of the modes' moduli point, and random members; and from the worst of
them the search goes uphill from corner to corner. All of it at each posture, which is part of the box as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import ValueRangeError
from passiflex.limits.box_slopes import steepest
from passiflex.problems.problem import SampledProblem
from passiflex.problems.resolution import SCALED
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.loop_at_rest import standing

Array = NDArray[np.float64]
Gains = Mapping[str, Array]

FIELDS = {
    "B": SCALED["motor_inertia"],
    "K": SCALED["joint_stiffness"],
    "D": SCALED["joint_damping"],
    "link inertia": SCALED["link_inertia"],
}
"""What can be off, joint by joint, and the numbers of the robot that go with it."""
NEAR = 0.3
"""How far from a posture of the set each joint may be [rad, m]."""
STARTS, CLIMBS, SHARES = 3, (2, 5), (1.0, 0.4, 0.15, 0.0)
"""From how many members a thorough search goes uphill, how many steps a quick and a thorough one go, and the shares of
the coordinates that a step moves."""
DRAWN, BASES, SEED = 24, 5, 20
"""Random members of each posture, places beside it from which slopes are followed, and the seed of both."""
SETTLING = 0.5
"""[1/s] Whatever trembles must die out at least this fast."""


class Member(NamedTuple):
    """A robot of the box: number of the posture, and where in the box it is, −1 to 1 in each coordinate.

    `off` holds B, K, D and the links' inertia of each joint, the delay, and the joint angles: (5 n + 1,).
    """

    posture: int
    off: tuple[float, ...]


class Worst(NamedTuple):
    """Where the spectral radius is largest."""

    radius: float
    member: Member

    @property
    def stable(self) -> bool:
        """Return whether all are stable."""
        return self.radius < 1


@dataclass(frozen=True, eq=False)
class MarginBox:
    """The robots that a margin stands for, at all postures of a set and near them.

    Attributes
    ----------
    problems: One for each posture, sampled, with the nominal robot, which is what the law knows.
    margin: Share by which B, K, D and the links' inertia may be off, each joint by itself, and periods by which the
        delay may.
    """

    problems: tuple[SampledProblem, ...]
    margin: float
    _nominal: dict[int, LinearLoop] = field(default_factory=dict)
    _loops: dict[Member, tuple[LinearLoop, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the margin."""
        if not 0 <= self.margin < 1:
            raise ValueRangeError("margin", got=f"{self.margin:g}", needs="0 to below 1, as 0.2 for 20 %")

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return self.problems[0].law.robot.n

    def centre(self, posture: int) -> Member:
        """Return the nominal robot at a posture."""
        return Member(posture, (0.0,) * (5 * self.n + 1))

    def centres(self) -> tuple[Member, ...]:
        """Return the nominal robot at each posture."""
        return tuple(self.centre(i) for i in range(len(self.problems)))

    def bases(self, posture: int) -> Iterator[Member]:
        """Yield the nominal robot at a posture, and at some beside it: slopes of one do not tell of all the others."""
        rng = np.random.default_rng([SEED, posture])
        yield self.centre(posture)
        for _ in range(BASES if self.margin else 0):
            beside = rng.choice([-1.0, 1.0], self.n)
            yield Member(posture, (*(0.0,) * (4 * self.n + 1), *beside.tolist()))

    def corners(self, posture: int) -> Iterator[Member]:
        """Yield the corners that are common to all joints, at the posture itself."""
        if self.margin == 0:
            return
        for signs in itertools.product((1.0, -1.0), repeat=5):
            off = np.concatenate([np.repeat(signs[:4], self.n), signs[4:], np.zeros(self.n)])
            yield Member(posture, tuple(off.tolist()))

    def usual_suspects(self) -> Iterator[Member]:
        """Yield the common corners that have decided most often: light motors, stiff joints, little damping, late."""
        for i in range(len(self.problems)) if self.margin else ():
            for links in (-1.0, 1.0):
                signs = np.repeat([-1.0, 1.0, -1.0, links], self.n)
                yield Member(i, (*signs.tolist(), 1.0, *(0.0,) * self.n))

    def drawn(self, posture: int, count: int, seed: int = SEED) -> Iterator[Member]:
        """Yield random members: half of them corners, half anywhere."""
        rng = np.random.default_rng([seed, posture])
        for i in range(count):
            off = rng.uniform(-1, 1, 5 * self.n + 1)
            yield Member(posture, tuple((np.sign(off) if i % 2 else off).tolist()))

    def loop(self, member: Member) -> tuple[LinearLoop, float]:
        """Return the loop of a member, and its delay [s]."""
        if member not in self._loops:
            self._loops[member] = self._standing(self.problems[member.posture], member), self.late(member)
        return self._loops[member]

    def radius(self, member: Member, gains: Gains, settling: float = SETTLING) -> float:
        """Return the radius of what trembles in a member with these gains, as `LinearLoop.trembling` has it."""
        loop, late = self.loop(member)
        return loop.trembling(late, gains, settling)

    def worst(self, gains: Gains, members: Sequence[Member]) -> Worst:
        """Return the worst of some members."""
        return max(Worst(self.radius(m, gains), m) for m in members)

    def search(self, gains: Gains, posture: int, *, thorough: bool = True) -> Worst:
        """Return the worst member that is found at a posture; thorough: with all common corners and random members."""
        tried = []
        for base in self.bases(posture) if thorough else (self.centre(posture),):
            tried += [base, *(self._uphill(base, slope) for slope in steepest(self, base, gains))]
        if not thorough:
            return self._climbed(self.worst(gains, tried), gains, CLIMBS[False])
        tried += [*self.corners(posture), *self.drawn(posture, DRAWN)]
        found = sorted((Worst(self.radius(m, gains), m) for m in tried), reverse=True)
        best = max(self._climbed(start, gains, CLIMBS[True]) for start in found[:STARTS])
        return self._turned(best, gains)

    def _climbed(self, found: Worst, gains: Gains, steps: int) -> Worst:
        """Return the worst member on the way uphill from one: to corners that slopes point to, or part of the way."""
        for _ in range(steps if self.margin else 0):
            slopes = steepest(self, found.member, gains, dominant=True)
            ways = {self._uphill(found.member, slope, share) for slope in slopes for share in SHARES}
            higher = max(Worst(self.radius(m, gains), m) for m in ways)
            if higher.radius <= found.radius:
                return found
            found = higher
        return found

    def _turned(self, found: Worst, gains: Gains) -> Worst:
        """Return the worst member after turning one coordinate after another to its other end, where that is worse."""
        for j in range(5 * self.n + 1 if self.margin else 0):
            off = list(found.member.off)
            off[j] = -1.0 if off[j] > 0 else 1.0
            member = Member(found.member.posture, tuple(off))
            found = max(found, Worst(self.radius(member, gains), member))
        return found

    @property
    def tried(self) -> int:
        """Return how many members have been looked at."""
        return len(self._loops)

    def words(self, member: Member) -> str:
        """Return a member in words."""
        if not any(member.off):
            return "nothing off"
        off, n, parts = np.array(member.off), self.n, []
        for i, name in enumerate(FIELDS):
            parts.append(f"{name} {_signs(off[i * n : (i + 1) * n])}")
        parts.append(f"delay {_signs(off[4 * n : 4 * n + 1])}")
        if off[4 * n + 1 :].any():
            parts.append(f"joints {NEAR:g} rad beside it")
        return ", ".join(parts)

    def plant(self, member: Member) -> dict[str, Array]:
        """Return the numbers of the member's robot that are off, by the names of `robot.layout`."""
        problem, off = self.problems[member.posture], np.array(member.off)
        true, n = problem.law.robot.layout.unpack(problem.plant), self.n
        return {
            name: (true[name].T * (1 + self.margin * off[i * n : (i + 1) * n])).T
            for i, names in enumerate(FIELDS.values())
            for name in names
        }

    def angles(self, member: Member) -> Array:
        """Return the member's posture, within the joints' ranges."""
        problem = self.problems[member.posture]
        near = NEAR * np.array(member.off)[4 * self.n + 1 :] if self.margin else 0.0
        low, high = problem.law.robot.position_limit.T
        return np.asarray(np.clip(problem.q + near, np.minimum(low, problem.q), np.maximum(high, problem.q)))

    def _standing(self, problem: SampledProblem, member: Member) -> LinearLoop:
        off = np.array(member.off)
        moved = bool(off[4 * self.n + 1 :].any())
        at = standing(problem, self.angles(member), self.plant(member))
        if moved or np.any(at.held):
            return LinearLoop(problem, at)
        return self._own(member.posture).beside(at)

    def late(self, member: Member) -> float:
        """Return the delay [s] of a member: the jitter and so many periods around it are part of the box."""
        s, off = self.problems[0], member.off
        share, spread = off[4 * self.n], self.margin * s.period
        return max(s.delay + s.jitter * (1 + share) / 2 + spread * share, 0.0)

    def _own(self, posture: int) -> LinearLoop:
        if posture not in self._nominal:
            self._nominal[posture] = LinearLoop(self.problems[posture])
        return self._nominal[posture]

    def _uphill(self, member: Member, slope: Array, share: float = 1.0) -> Member:
        """Return the member with the coordinates that matter most at the ends to which the slope points."""
        off = np.array(member.off)
        gain = np.abs(slope) * np.abs(np.sign(slope) - off)
        count = max(1, math.ceil(share * (gain > 0).sum()))
        moved = np.argsort(-gain)[:count]
        off[moved] = np.where(slope[moved] == 0, off[moved], np.sign(slope[moved]))
        return Member(member.posture, tuple(off.tolist()))


def _signs(off: Array) -> str:
    """Return − or +, or both where joints differ."""
    if np.ptp(off) == 0:
        return "+" if off[0] > 0 else "−" if off[0] < 0 else "as it is"
    return "".join("+" if v > 0 else "−" if v < 0 else "0" for v in np.round(off, 1))
