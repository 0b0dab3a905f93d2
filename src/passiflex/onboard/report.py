"""What a controller says of its last period, and why it holds something back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from passiflex.onboard.settings import WatchSettings

NEARLY = 1 - 1e-9
"""A share below it is held back."""


class Report(NamedTuple):
    """The last period.

    Attributes
    ----------
    level: Of the tank [J]; nan without one.
    bound: Most that errors of the sensors let it claim too much [J].
    reference_share, stiffness_share: Of what was asked for, that was granted.
    valve: 0 to 1, of feed-forward, posture and friction compensation.
    latched: Whether the law has fallen back, for good.
    faults: Readings so far that were not finite.
    stiffness_scale: σ of the watch, 0 to 1.
    setpoint_age, silent_time, frozen_time: [s].
    why: What is held back, and why; empty if nothing is.
    """

    level: float
    bound: float
    reference_share: float
    stiffness_share: float
    valve: float
    latched: bool
    faults: int
    stiffness_scale: float
    setpoint_age: float
    silent_time: float
    frozen_time: float
    why: str


def reasons(report: Report, watch: WatchSettings, floor: float, *, runs: bool) -> Iterator[str]:
    """Yield what is held back, and why."""
    if report.silent_time > 0:
        yield f"no finite reading for {report.silent_time:.3g} s: the torque is held" + (
            ", then let go" if report.silent_time >= watch.silent_after else ""
        )
    if report.frozen_time >= watch.frozen_after:
        yield f"the readings have not changed by a bit for {report.frozen_time:.3g} s: the arm is let go"
    if not runs:
        yield "stopping" if report.stiffness_scale > 0 else "stopped"
    elif report.setpoint_age >= watch.soften_after:
        yield f"no setpoint for {report.setpoint_age:.3g} s: the arm is let go"
    elif report.setpoint_age >= watch.stale_after:
        yield f"no setpoint for {report.setpoint_age:.3g} s: the reference stands still"
    if report.latched:
        yield "the tank was overdrawn: the law has fallen back, and holds the pose it was in"
    elif report.reference_share < NEARLY or report.stiffness_share < NEARLY:
        what = "the reference" if report.reference_share < NEARLY else "the stiffness"
        yield (
            f"the tank pays for {min(report.reference_share, report.stiffness_share):.0%} of what {what} asks: "
            f"{report.level:.3g} J, less {report.bound:.2g} J that the sensors may have wrong, over a floor of "
            f"{floor:.3g} J"
        )
    if report.valve < NEARLY and not report.latched:
        yield f"the valve lets {report.valve:.0%} of force, posture and friction compensation through"
