"""The least B_e of each joint for which a box of robots holds and noise stays small: no joint pays for another."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from passiflex.control.gravity import RobotGravity
from passiflex.errors import ValueRangeError
from passiflex.limits.margin_box import MarginBox, Member, Worst
from passiflex.limits.torque_noise import torque_by_noise
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.stability.modes import lasting, trembles

Array = NDArray[np.float64]

FLOORS = {"plain": 0.01, "matched": 0.03}
"""Least B_e/B. The matched loop is stable far below 0.03 B, but bears less delay there and makes more noise."""
MOST = 4.0
"""Largest B_e/B."""
NOISE_SHARE = 1 / 10
"""Most motor torque that the torque sensors' noise may make, rms, as a share of a joint's limit; nominal robot."""
WORST_SHARE = 1 / 4
"""The same for the members of the box that decide: a quarter, and the limit is hardly ever met."""
STEPS = (0.7, 0.84, 0.93)
"""By which all B_e are raised together, and each is then lowered: later on the last step alone."""
SURELY = 2.0
"""[1/s] What trembles dies out this fast on the members that are known, so that the next search finds none beyond."""
DIGITS = 3
"""To which B_e is rounded, up."""
QUIETER, LOUDER, NEARLY = 40, 1.25, 0.7
"""Steps up against noise, the largest of them, and the share of what is allowed from which a member is asked again."""
ROUNDS = 24
"""Searches of the box at most; each finds members that decide, or ends."""


class UnattainableError(ValueRangeError):
    """No B_e holds on the box."""


class HeavierError(ValueRangeError):
    """What holds needs more B_e than another inner loop does."""


class InertiaSearch:
    """B_e/B per joint: raised together until all members that were found hold, then lowered one by one.

    The members that decide are kept: a box is searched only for what its law does not hold on yet.
    """

    def __init__(self, box: MarginBox, robot: FlexibleJointRobot, variance: float, inner_loop: str):
        self.box, self.robot, self.variance, self.inner_loop = box, robot, variance, inner_loop
        self.ratio = np.full(robot.n, FLOORS[inner_loop])
        self.floor = self.ratio.copy()
        self.active: list[Member] = [*box.centres(), *box.usual_suspects()]
        self.failed: list[Member] = []
        self.decided = ["floor"] * robot.n
        self.worst = Worst(0.0, box.centre(0))

    @property
    def mean(self) -> float:
        """Return the geometric mean of the ratios."""
        return float(np.exp(np.log(self.ratio).mean()))

    def begin(self) -> None:
        """Bring the ratios to where the members that mostly decide hold; `run` goes on from there, and only up.

        Raises
        ------
        UnattainableError
            If there are none up to `MOST`.
        """
        self._settle(first=True)

    def run(self, below: float = math.inf) -> None:
        """Find the ratios, after `begin` or `raise_all`.

        Raises
        ------
        UnattainableError
            If there are none up to `MOST`.
        HeavierError
            As soon as their mean is sure to be this much or more.
        """
        everywhere = list(range(len(self.box.problems)))
        places, thorough = everywhere, False
        for _ in range(ROUNDS):
            self._settle()
            if self.mean >= below:
                raise HeavierError(
                    "this inner loop needs more B_e", got=f"{self.mean / below:.2g} times as much"
                )
            self.floor = self.ratio.copy()  # from now on it is only raised, so that the rounds come to an end
            self.worst = Worst(0.0, self.box.centre(0))
            failing = []
            for place in places:
                if not self._passes(place, thorough=thorough):
                    failing.append(place)
                    if thorough:
                        break
            if not failing and thorough:
                return
            # Where it failed it is tried again, quickly; once nothing fails, thoroughly everywhere, and there first.
            everywhere.sort(key=lambda place: place not in failing)
            places, thorough = failing or everywhere, not failing
        raise UnattainableError(
            "no B_e holds with this margin", got=f"{ROUNDS} searches that still found members"
        )

    def _passes(self, posture: int, *, thorough: bool) -> bool:
        """Return whether nothing is found at a posture that trembles or is too loud; what is found is kept."""
        found = self.box.search(self.gains(), posture, thorough=thorough)
        self.worst = max(self.worst, found)
        if found.stable and not (self.variance and self._excess(found.member).max() > 1):
            return True
        self.active += [found.member] if found.member not in self.active else []
        return False

    def raise_all(self, factor: float, why: str) -> None:
        """Raise all joints by a factor: a floor from then on."""
        self.floor = np.minimum(self.ratio * factor, MOST)
        self.ratio, self.decided = self.floor.copy(), [why] * self.robot.n

    def gains(self, ratio: Array | None = None) -> dict[str, Array]:
        """Return K_e and B_e, rounded up."""
        ratio = self.ratio if ratio is None else ratio
        inertia = np.array([_rounded_up(v) for v in ratio * self.robot.motor_inertia])
        return {"shaped_stiffness": self.robot.joint_stiffness, "shaped_inertia": inertia}

    def noise(self, member: Member, gains: Mapping[str, Array]) -> Array:
        """Return the rms torque by noise of each motor of a member."""
        loop, late = self.box.loop(member)
        return torque_by_noise(loop, self.variance, late, gains)

    def _settle(self, *, first: bool = False) -> None:
        """Bring the ratios to where all active members hold and none is too loud."""
        step = STEPS[0] if first else STEPS[-1]
        while not self._holds(self.ratio, self.active):
            factor = self._least(lambda f: self._holds(np.minimum(self.ratio * f, MOST), self.active), step)
            self.ratio = np.minimum(self.ratio * factor, MOST)
            if first:
                self._lower(STEPS)
            else:
                self._let_go()
        asked = list(self.active) if self.variance else []
        for _ in range(QUIETER):
            excess = [self._excess(m) for m in asked]
            if not excess or np.max(excess) <= 1:
                return
            # Near the border of stability it is resonance that is loud: a little more B_e, and it is gone.
            self._set(self.ratio * np.clip(np.max(excess, axis=0), 1, LOUDER), "noise")
            asked = [m for m, e in zip(asked, excess, strict=True) if e.max() > NEARLY]
        raise UnattainableError(
            "no B_e keeps the torque sensors' noise small", got=f"{QUIETER} steps up in vain"
        )

    def _lower(self, steps: Sequence[float]) -> None:
        """Lower the joints in turn, a step each, as far as the members bear it that failed before.

        In ever finer steps, so that no joint is lowered at the cost of another. Whether the members that
        never failed bear it too is seen later.
        """
        for step in steps:
            movable = self.ratio > self.floor
            while movable.any():
                for joint in np.flatnonzero(movable).tolist():
                    lower = self._one(joint, max(self.ratio[joint] * step, self.floor[joint]))
                    movable[joint] = lower[joint] > self.floor[joint]
                    if self._holds(lower, self.failed):
                        self.ratio = lower
                    else:
                        movable[joint], self.decided[joint] = False, "margin"

    def _let_go(self) -> None:
        """Lower each joint as far as the members bear it: those first that the last of them minds least."""
        newest = self.failed[0]

        def with_floor(joint: int) -> float:
            return self.box.radius(newest, self.gains(self._one(joint, self.floor[joint])), SURELY)

        for joint in sorted(np.flatnonzero(self.ratio > self.floor).tolist(), key=with_floor):
            low, high = float(self.floor[joint]), float(self.ratio[joint])
            if self._holds(self._one(joint, low), self.failed):
                high = low
            else:
                self.decided[joint] = "margin"
            while low < STEPS[-1] * high:
                middle = math.sqrt(low * high)
                low, high = (
                    (low, middle) if self._holds(self._one(joint, middle), self.failed) else (middle, high)
                )
            self.ratio[joint] = high

    def _one(self, joint: int, value: float) -> Array:
        """Return the ratios with one joint's replaced."""
        ratio = self.ratio.copy()
        ratio[joint] = value
        return ratio

    def _holds(self, ratio: Array, members: list[Member]) -> bool:
        """Return whether these members hold; the one that failed last is asked first."""
        gains = self.gains(ratio)
        order = sorted(members, key=lambda m: self.failed.index(m) if m in self.failed else len(members))
        for member in order:
            if self.box.radius(member, gains, SURELY) >= 1:
                self.failed = [member, *(m for m in self.failed if m != member)]
                return False
        return True

    def _least(self, holds: Callable[[float], bool], step: float) -> float:
        """Return the least common factor that holds, to half a step in the logarithm."""
        low, high = 1.0, 1 / step
        while not holds(high):
            if (self.ratio * high >= MOST).all():
                raise UnattainableError(
                    "no B_e holds with this margin",
                    got=f"B_e raised to {MOST:g} B in vain with the {self.inner_loop} inner loop: {self._why()}",
                    needs="a loop that is stable on every robot of the margin",
                )
            low, high = high, high / step
        while high / low > step**-0.6:
            middle = math.sqrt(low * high)
            low, high = (low, middle) if holds(middle) else (middle, high)
        return high

    def _why(self) -> str:
        """Return the member that holds with no B_e in words, and what it does."""
        member, heavy = self.failed[0], self.gains(np.full(self.robot.n, MOST))
        loop, late = self.box.loop(member)
        values = lasting(loop.matrix(None, late, heavy), loop.cycle(), loop.task_jacobian)
        slow = values[~trembles(values, loop.cycle())]
        falls = np.abs(slow).max(initial=0.0) >= 1
        what = "it trembles"
        if falls:
            weight = not isinstance(loop.problem.law.gravity, RobotGravity)
            what = "a slow motion does not die out" + ", as K_x is soft for the weight that is off" * weight
        return f"{self.box.words(member)}; {what}"

    def _excess(self, member: Member) -> Array:
        """Return each motor's torque by noise as a multiple of what is allowed."""
        share = WORST_SHARE if any(member.off) else NOISE_SHARE
        torque = self.noise(member, self.gains()) / (share * self.robot.torque_limit)
        torque = np.nan_to_num(torque, nan=np.inf, posinf=np.inf)
        return np.where((torque > 1) & (torque < 1 + 1e-3), 1 + 1e-3, torque)

    def _set(self, ratio: Array, why: str) -> None:
        if (ratio > MOST).any():
            raise UnattainableError(
                "no B_e keeps the torque sensors' noise small",
                got=f"B_e raised to {MOST:g} B in vain",
                needs=f"a torque by noise below {NOISE_SHARE:.0%} of each joint's limit".replace("%", " %"),
            )
        self.decided = [
            why if new > old else was for new, old, was in zip(ratio, self.ratio, self.decided, strict=True)
        ]
        self.ratio = ratio


def _rounded_up(value: float) -> float:
    """Return the value with `DIGITS` digits, rounded up."""
    places = DIGITS - 1 - math.floor(math.log10(value))
    return math.ceil(round(value * 10**places, 6)) / 10**places
