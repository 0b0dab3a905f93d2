"""What `recommend` returns: gains, what they were tried against, and what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from passiflex.limits.margin_box import NEAR, Worst
from passiflex.stability.clock_words import delay_words, hertz

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recommendation:
    """Gains that hold with a margin.

    Attributes
    ----------
    robot, rate, delay, inner_loop: What they are for; [Hz], [s].
    margin: B, K, D and the links' inertia of each joint may be off by this share, the delay by this share of a period.
    shaped_stiffness: K_e = K (n,) N m/rad. With it K_F of (6) is 0, and the law needs no τ_e.
    shaped_inertia: B_e (n,) kg m^2.
    inertia_ratio: B_e/B (n,).
    postures: Where it was tried (p, n) rad, and near them.
    worst: Largest radius per period of what trembles, and on which member of the box.
    corner: That member in words.
    searched: How many members of the box were looked at.
    torque_noise: Motor torque that the torque sensors' noise makes, rms, at the worst posture for it (n,) N m.
    torque_limit: Of the robot (n,) N m.
    decided_by: Per joint what decided B_e: floor, noise, margin, fallback, missed periods or simulation.
    entry: The sections of a scenario with these gains, complete.
    other: Why the other inner loop is not as good; empty if it was not tried.
    """

    robot: str
    rate: float
    delay: float
    inner_loop: str
    margin: float
    shaped_stiffness: Array
    shaped_inertia: Array
    inertia_ratio: Array
    postures: Array
    worst: Worst
    corner: str
    searched: int
    torque_noise: Array
    torque_limit: Array
    decided_by: tuple[str, ...]
    entry: Mapping[str, Any]
    other: str = ""

    @property
    def sentence(self) -> str:
        """Return what holds, in words."""
        low, high = self.inertia_ratio.min(), self.inertia_ratio.max()
        ratios = f"{low:.2g}" if f"{low:.2g}" == f"{high:.2g}" else f"{low:.2g} to {high:.2g}"
        shares = self.torque_noise / self.torque_limit
        joint = int(np.argmax(shares))
        other = f" ({self.other})" if self.other else ""
        return (
            f"{self.robot} at {hertz(self.rate)} with {delay_words(self.delay * self.rate)}: K_e = K and B_e = "
            f"{ratios} B with the {self.inner_loop} inner loop{other}\n"
            f"hold at {len(self.postures)} postures and within {NEAR:g} rad of them with B, K, D and the links' "
            f"inertia of each joint off by up to {100 * self.margin:g} % and the delay by {self.margin:g} periods\n"
            f"worst of {self.searched} members that were looked at: radius {self.worst.radius:.5f} at posture "
            f"{self.worst.member.posture + 1} with {self.corner}\n"
            f"the torque sensors' noise makes {self.torque_noise[joint]:.2g} N m rms in motor {joint + 1}, "
            f"{100 * shares[joint]:.0f} % of its limit"
        )

    @property
    def snippet(self) -> str:
        """Return the sections of a scenario file that say these gains: each stands for the one that is there."""
        text = yaml.safe_dump(
            dict(self.entry), sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
        )
        ratios = ", ".join(f"{v:.2g}" for v in self.inertia_ratio)
        return (
            f"# K_e = K: the law needs no τ_e; B_e is B times {ratios}\n"
            "# each section stands for the one of its name in the scenario, whatever else is there stays\n"
            f"{text}"
        )
