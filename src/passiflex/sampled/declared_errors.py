"""What the sensors may get wrong, as the books of a controller are told: sizes, no signs."""

from __future__ import annotations

from typing import Protocol

import casadi as cs

from passiflex.layout import Field, Layout


class ErrorNumbers(Protocol):
    """The declared errors in symbols, as `error_layout` says."""

    torque_offset: cs.SX
    torque_scale: cs.SX
    torque_bandwidth: cs.SX
    link_resolution: cs.SX
    noise_deviation: cs.SX
    noise_hold: cs.SX
    noise_credit: cs.SX
    bend: cs.SX
    period: cs.SX
    link_deviation: cs.SX
    noise_debit: cs.SX
    jitter_mean: cs.SX
    jitter_share: cs.SX
    late: cs.SX
    pairing: cs.SX


def error_layout(n: int) -> Layout:
    """Return the declared errors of the measurement; 0 stands for none, `UNFILTERED` for no low-pass."""
    return Layout(
        (
            Field("torque_offset", (n,), "N m", "largest constant error of τ_a, ≥ 0"),
            Field("torque_scale", (n,), "1", "largest relative error of τ_a, 0 to 1/2"),
            Field("torque_bandwidth", (), "rad/s", "pole of the torque sensors"),
            Field("link_resolution", (), "rad", "step of q"),
            Field("noise_deviation", (), "N m", "standard deviation of the noise on τ_a"),
            Field("noise_hold", (), "s", "how long a sample of the noise lasts"),
            Field("noise_credit", (), "W", "mean power with which it credits the tank"),
            Field("bend", (), "1", "`BEND`; 0 trusts the trapezoid"),
            Field("period", (), "s", "time between two readings without a gap"),
            Field("link_deviation", (), "rad", "standard deviation of the noise on q"),
            Field("noise_debit", (), "W", "mean power that the noise on q takes from the tank's level"),
            Field("jitter_mean", (), "J", "what noise on q and θ adds to S at rest, at most"),
            Field("jitter_share", (), "J", "largest eigenvalue of its covariance in the metric of S"),
            Field("late", (), "1", "periods until q and τ_a of an instant have been read"),
            Field("pairing", (), "1", "periods by which the earlier of the two comes earlier"),
        ),
        ErrorNumbers,
    )
