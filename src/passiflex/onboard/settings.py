"""How a controller watches a robot, and how it approaches what it is asked, in numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from passiflex.errors import ValueRangeError


@dataclass(frozen=True)
class WatchSettings:
    """Times [s] after which something is done about setpoints and readings.

    Attributes
    ----------
    stale_after: Without a setpoint, the reference stands still.
    soften_after: Without a setpoint, the stiffness goes.
    frozen_after: Of readings that are equal to the last bit, it goes; inf for an ideal robot, which may stand so.
    silent_after: Without a finite reading, the stiffness goes, and the torque to what carries the arm.
    soften: In which it goes.
    soft_start: In which it comes; 0 for at once.

    Raises
    ------
    ValueRangeError
        For a time that is negative or no number.
    """

    stale_after: float = 0.1
    soften_after: float = 1.0
    frozen_after: float = 0.5
    silent_after: float = 0.02
    soften: float = 1.0
    soft_start: float = 1.0

    def __post_init__(self) -> None:
        """Refuse times that are none."""
        for name, value in asdict(self).items():
            if not value >= 0:
                raise ValueRangeError(f"{name} of the watch", got=value, needs="a time of 0 s or more")

    @classmethod
    def off(cls) -> WatchSettings:
        """Return a watch that never acts: for a plant that is simulated."""
        never = np.inf
        return cls(never, never, never, never, 0.0, 0.0)

    @property
    def numbers(self) -> dict[str, float]:
        """Return the values of `watch_layout`."""
        return {name: min(value, 1e9) for name, value in asdict(self).items()}


@dataclass(frozen=True)
class ApproachSettings:
    """How what is asked for is approached.

    Attributes
    ----------
    ramp: Time in which a setpoint is gone over to, pose and gains [s]; 0 for at once. Of messages at 10 Hz, 0.1 s.
    speed, turn_rate: Largest of the reference [m/s, rad/s].

    Raises
    ------
    ValueRangeError
        For one that is negative or no number.
    """

    ramp: float = 0.0
    speed: float = np.inf
    turn_rate: float = np.inf

    def __post_init__(self) -> None:
        """Refuse numbers that are none."""
        for name, value in asdict(self).items():
            if not value >= 0:
                raise ValueRangeError(f"{name} of the approach", got=value, needs="0 or more")

    @property
    def numbers(self) -> dict[str, float]:
        """Return the values of `approach_layout`."""
        return {name: min(value, 1e9) for name, value in asdict(self).items()}
