"""What `recommend` returns: gains, what they were tried against, and what was found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from passiflex.limits.robust import Worst
from passiflex.simulation.admissible import delay_words, hertz

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recommendation:
    """Gains that hold with a margin.

    Attributes
    ----------
    robot, rate, delay, inner_loop: What they are for; [Hz], [s].
    margin: B, K, D and the links' inertia may be off by this share, the delay by this share of a period.
    shaped_stiffness: K_e = K (n,) N m/rad. With it K_F of (6) is 0, and the law needs no τ_e.
    shaped_inertia: B_e (n,) kg m^2.
    inertia_ratio: B_e/B (n,).
    postures: Where it was tried (p, n) rad.
    worst: Largest spectral radius, and at which posture and perturbation.
    torque_noise: Motor torque that the torque sensors' noise makes, rms, at the worst posture for it (n,) N m.
    torque_limit: Of the robot (n,) N m.
    decided_by: Per joint what decided B_e: floor, noise or margin.
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
    torque_noise: Array
    torque_limit: Array
    decided_by: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """Return what holds, in words."""
        low, high = self.inertia_ratio.min(), self.inertia_ratio.max()
        ratios = f"{low:.2g}" if f"{low:.2g}" == f"{high:.2g}" else f"{low:.2g} to {high:.2g}"
        late = delay_words(self.delay * self.rate)
        shares = self.torque_noise / self.torque_limit
        joint = int(np.argmax(shares))
        return (
            f"{self.robot} at {hertz(self.rate)} with {late}, inner loop {self.inner_loop}: K_e = K and "
            f"B_e = {ratios} B hold at {len(self.postures)} postures with B, K, D and the links' inertia off by "
            f"{100 * self.margin:g} % and the delay by {self.margin:g} periods; radius at most "
            f"{self.worst.radius:.5f}, at posture {self.worst.posture + 1} with {self.worst.perturbation}; the "
            f"torque sensors' noise makes {self.torque_noise[joint]:.2g} N m rms in motor {joint + 1}, "
            f"{100 * shares[joint]:.0f} % of its limit"
        )

    @property
    def snippet(self) -> str:
        """Return the part of a scenario file that says these gains."""
        joints = ", ".join(f"{v:g}" for v in self.shaped_inertia)
        ratios = ", ".join(f"{v:.2g}" for v in self.inertia_ratio)
        return (
            "law:\n"
            "  shaped_stiffness: {ratio: 1}      # K_e = K: the law needs no τ_e\n"
            f"  shaped_inertia: {{value: [{joints}], unit: kg m^2}}      # B times {ratios}\n"
            "control:\n"
            f"  rate: {self.rate:g} Hz\n"
            f"  delay: {self.delay:g} s\n"
            f"  inner_loop: {self.inner_loop}\n"
            "  external_torque: none\n"
        )
