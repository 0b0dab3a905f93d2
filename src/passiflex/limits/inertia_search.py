"""The least B_e of each joint for which a box of robots holds and noise stays small: no joint pays for another."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import ValueRangeError
from passiflex.limits.margin_box import MarginBox, Member, Worst
from passiflex.limits.torque_noise import torque_by_noise
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation.modes import lasting, trembles

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
ROUNDS = 12
"""Searches of the box at most; each finds members that decide, or ends."""


class UnattainableError(ValueRangeError):
    """No B_e holds on the box."""


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

    def run(self) -> None:
        """Find the ratios.

        Raises
        ------
        UnattainableError
            If there are none up to `MOST`.
        """
        thorough = False
        for i in range(ROUNDS):
            self._settle(STEPS if i == 0 else STEPS[-1:])
            self.floor = (
                self.ratio.copy()
            )  # from here on it is only raised, so that the rounds come to an end
            places = range(len(self.box.problems))
            found = [self.box.search(self.gains(), p, thorough=thorough) for p in places]
            self.worst = max(found)
            failing = [w.member for w in found if not w.stable]
            if self.variance:
                failing += [w.member for w in found if w.stable and self._excess(w.member).max() > 1]
            if not failing and thorough:
                return
            self.active += [m for m in failing if m not in self.active]
            thorough = not failing
        raise UnattainableError(
            "no B_e holds with this margin", got=f"{ROUNDS} searches that still found members"
        )

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

    def _settle(self, steps: Sequence[float]) -> None:
        """Bring the ratios to where all active members hold and none is too loud."""
        while not self._holds(self.ratio, self.active):
            factor = self._least(
                lambda f: self._holds(np.minimum(self.ratio * f, MOST), self.active), steps[0]
            )
            self.ratio = np.minimum(self.ratio * factor, MOST)
            self._lower(steps)
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
                for joint in np.flatnonzero(movable):
                    lower = self.ratio.copy()
                    lower[joint] = max(lower[joint] * step, self.floor[joint])
                    movable[joint] = lower[joint] > self.floor[joint]
                    if self._holds(lower, self.failed):
                        self.ratio = lower
                    else:
                        movable[joint], self.decided[joint] = False, "margin"

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
        values = lasting(loop.matrix(None, late, heavy), loop.s.period, loop.task_jacobian)
        slow = values[~trembles(values, loop.s.period)]
        falls = np.abs(slow).max(initial=0.0) >= 1
        what = (
            "a slow motion falls away, as K_x is soft for the weight that is off" if falls else "it trembles"
        )
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
