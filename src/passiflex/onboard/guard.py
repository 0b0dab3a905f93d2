"""Messages of somebody who knows nothing of energy, as a policy or a teleoperator, made to setpoints that hold."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import PassiflexError, ValueRangeError
from passiflex.onboard.controller import Controller
from passiflex.onboard.setpoint import Setpoint
from passiflex.problems.altered import altered
from passiflex.stability.judgement import judge

Array = NDArray[np.float64]

MOST = 1000.0
"""Largest factor of the law's own gains that is looked for."""
HALVINGS = 9
ROOM = 0.5
"""Share of a factor at its border that is trusted."""
SLACK = 1e-6
"""Of the damping that the delay takes, round-off."""
ENTRIES = ("position", "rotation", "velocity", "acceleration", "stiffness", "damping", "wrench", "posture")
"""What a message may have."""


class Trusted(NamedTuple):
    """Gains that hold where the robot started: K_x ≼ `stiffness` and D_x ≼ `damping`, each within half of its border.

    Attributes
    ----------
    stiffness, damping: (k, k).
    stiffness_factor, damping_factor: Of the law's own.
    late: From a reading to the middle of what it commands [s]: a spring needs D_x of that much K_x to lose energy.
    """

    stiffness: Array
    damping: Array
    stiffness_factor: float
    damping_factor: float
    late: float


class Guard:
    """Takes messages from any thread, and hands the newest to the loop, with gains that hold.

        guard = pf.Guard(controller)                              # after controller.start
        said = guard.send(position=x, stiffness=[300] * 6)        # in the policy's thread, 10 to 200 Hz
        torque = controller.step(sensed, guard.take(), elapsed)   # in the loop

    What is no setpoint is refused in words, and the one before stays. Gains beyond what the judge of stability trusts
    are scaled down to it, and damping that the delay would eat is raised. How a jump is gone over to is the
    controller's `approach`, what it may cost its tank's.
    """

    def __init__(self, controller: Controller):
        self.controller = controller
        self.trusted = trusted(controller)
        self.received = self.refused = self.reduced = 0
        self.said = ""
        self._lock = threading.Lock()
        self._newest: Setpoint | None = None
        own = controller.problem.law.layout.unpack(controller.problem.gains)
        self._gains: dict[str, Array] = {name: own[name] for name in ("stiffness", "damping")}

    def send(self, **message: Any) -> str:
        """Take a message, with entries as a `Setpoint` has them; return why it is not followed as it is, if so."""
        said, setpoint = self._checked(message)
        with self._lock:
            self.received += 1
            self.said = said
            if setpoint is None:
                self.refused += 1
            else:
                self.reduced += bool(said)
                self._newest = setpoint
        return said

    def take(self) -> Setpoint | None:
        """Return the newest setpoint, once; None if there is no new one."""
        with self._lock:
            newest, self._newest = self._newest, None
        return newest

    def _checked(self, message: dict[str, Any]) -> tuple[str, Setpoint | None]:
        for name in message:
            if name not in ENTRIES:
                return f"refused: a setpoint has no {name!r}; it has {', '.join(ENTRIES)}", None
        try:
            asked = Setpoint(**message)
            self._require_fit(asked)
        except PassiflexError as mistake:
            return f"refused: {mistake}", None
        told, gains = [], dict(self._gains)
        for name in gains:
            if (gain := getattr(asked, name)) is None:
                continue
            share = _share(gain, getattr(self.trusted, name))
            gains[name] = share * gain if share < 1 else gain
            if share < 1:
                told.append(
                    f"{name} scaled to {share:.3g} of it: more is not trusted at this rate and posture"
                )
        due = self.trusted.late * gains["stiffness"]
        if np.linalg.eigvalsh(gains["damping"] - due)[0] < -SLACK * np.abs(due).max():
            gains["damping"] = gains["damping"] + due
            told.append(
                f"damping raised by {1e3 * self.trusted.late:.3g} ms of the stiffness, which the delay takes"
            )
        self._gains = gains
        return "; ".join(told), Setpoint(**(message | gains)) if told else asked

    def _require_fit(self, asked: Setpoint) -> None:
        """Raise ValueRangeError for a setpoint of another robot or task."""
        for name, into in self.controller.asked.items():
            value = getattr(asked, name, None)
            if value is not None and value.shape != into.shape:
                raise ValueRangeError(f"{name} of a setpoint", got=value.shape, needs=f"shape {into.shape}")


def trusted(controller: Controller) -> Trusted:
    """Return gains that hold where the robot started, by the judge of stability, with what the robot says.

    Factors of the law's own K_x and D_x are raised until one does not hold: of D_x with the own K_x and with almost
    none, of K_x with the own D_x, with almost none, and with that much. Half of each is trusted.
    """
    problem = controller.problem
    own = problem.law.layout.unpack(problem.gains)
    K, D = own["stiffness"], own["damping"]

    def holds(stiffer: float, more: float) -> bool:
        return judge(altered(problem, gains={"stiffness": stiffer * K, "damping": more * D})).stable

    damped = _border(lambda more: holds(1.0, more) and holds(0.01, more))
    share = max(ROOM * damped, 1.0)
    stiff = _border(lambda more: all(holds(more, d) for d in (1.0, 0.1, share)))
    factor = max(ROOM * stiff, 1.0)
    late = problem.delay + problem.jitter + 1.5 * problem.period * problem.task_periods
    return Trusted(factor * K, share * D, factor, share, late)


def _border(holds: Callable[[float], bool]) -> float:
    """Return the largest factor from 1 on that holds, to a few percent; 1 if hardly more does."""
    low, high = 1.0, MOST
    if holds(high):
        return high
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _share(gain: Array, most: Array) -> float:
    """Return the largest share of a gain that is below another one, as matrices; 1 if all of it is."""
    values, vectors = np.linalg.eigh(most)
    held = values > 1e-9 * max(values[-1], 1e-300)
    within = vectors[:, held] / np.sqrt(values[held])
    beside = vectors[:, ~held].T @ gain @ vectors[:, ~held]
    if beside.size and np.abs(beside).max() > 1e-9 * np.abs(gain).max():
        return 0.0  # it acts where nothing is trusted
    largest = float(np.linalg.eigvalsh(within.T @ gain @ within)[-1]) if held.any() else 0.0
    return 1.0 if largest <= 1 else 1 / largest
