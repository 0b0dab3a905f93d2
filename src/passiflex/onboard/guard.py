"""Messages of somebody who knows nothing of energy, as a policy or a teleoperator, made to setpoints that hold."""

from __future__ import annotations

import threading
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import fields
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import PassiflexError, ValueRangeError
from passiflex.onboard.controller import Controller
from passiflex.onboard.judged_gains import Gains, Judged, judged, prepare
from passiflex.onboard.setpoint import Setpoint

Array = NDArray[np.float64]

ENTRIES = tuple(field.name for field in fields(Setpoint))
"""What a message may have."""
GAINS = Gains._fields
PATIENCE = 60.0
"""How long `wait` waits [s]."""


class Counts(NamedTuple):
    """How many messages came, were refused, and had gains that were taken in part only."""

    received: int = 0
    refused: int = 0
    reduced: int = 0


class Guard:
    """Takes messages from any thread, and hands the newest to the loop; gains only once they were judged.

        with pf.Guard(controller) as guard:                               # after controller.start
            said = guard.send(position=x, stiffness=[300] * 6)            # in the policy's thread, 10 to 200 Hz
            torque = controller.step(sensed, guard.take(), elapsed)       # in the loop

    What is no setpoint is refused in words, and the one before stays. A pose is handed over at once, new gains when a
    process of its own has found that they hold at this rate, with what the robot says, where it started: tens of
    milliseconds. If they do not, they are taken as far on the way from those before as holds. Of gains that come
    faster than that the newest count. How a jump is gone over to is the controller's `approach`, what it may cost its
    tank's.

    Attributes
    ----------
    counts: Of messages.
    said: Of the newest message that was not followed as it was, and of gains: why.
    """

    def __init__(self, controller: Controller):
        self.controller = controller
        self.counts, self.said = Counts(), ""
        own = controller.problem.law.layout.unpack(controller.problem.gains)
        self._gains = self._wanted = Gains(own["stiffness"], own["damping"])
        self._lock = threading.Lock()
        self._newest: Setpoint | None = None
        self._message: dict[str, Any] = {}
        self._pending: Future[Judged] | None = None
        self._closed = False
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), prepare, (controller.problem.text,))

    def __enter__(self) -> Guard:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process that judges gains; those in force stay."""
        with self._lock:
            self._closed = True
        self._pool.shutdown(cancel_futures=True)

    def send(self, /, **message: Any) -> str:
        """Take a message, with entries as a `Setpoint` has them; return why it is refused, else nothing."""
        try:
            asked = self._checked(message)
        except PassiflexError as mistake:
            said = f"refused: {mistake}"
            with self._lock:
                received, refused, reduced = self.counts
                self.counts, self.said = Counts(received + 1, refused + 1, reduced), said
            return said
        with self._lock:
            self.counts = self.counts._replace(received=self.counts.received + 1)
            self._message = {name: value for name, value in message.items() if name not in GAINS}
            self._newest = Setpoint(**self._message)
            wanted = Gains(
                *(self._wanted[i] if (v := getattr(asked, n)) is None else v for i, n in enumerate(GAINS))
            )
            changed = not wanted.same(self._wanted)
            self._wanted = wanted
            if changed and self._pending is None and not self._closed:
                self._judge()
        return ""

    def take(self) -> Setpoint | None:
        """Return the newest setpoint, once; None if there is no new one."""
        with self._lock:
            newest, self._newest = self._newest, None
        return newest

    def wait(self) -> None:
        """Wait until all gains that were sent are judged."""
        while (pending := self._pending) is not None:
            pending.result(PATIENCE)
            threading.Event().wait(1e-3)  # for what is done with it

    def _checked(self, message: dict[str, Any]) -> Setpoint:
        """Return what a message asks for.

        Raises
        ------
        ValueRangeError
            If it is no setpoint of this robot and task.
        """
        for name in message:
            if name not in ENTRIES:
                raise ValueRangeError(f"a setpoint has no {name!r}", needs=f"some of {', '.join(ENTRIES)}")
        asked = Setpoint(**message)
        for name, into in self.controller.asked.items():
            value = getattr(asked, name, None)
            if value is not None and value.shape != into.shape:
                raise ValueRangeError(f"{name} of a setpoint", got=value.shape, needs=f"shape {into.shape}")
        return asked

    def _judge(self) -> None:
        """Have the gains judged that are wanted; the lock is held."""
        self._pending = self._pool.submit(judged, self._wanted, self._gains)
        self._pending.add_done_callback(self._done)

    def _done(self, found: Future[Judged]) -> None:
        """Hand over gains that were judged."""
        if found.cancelled() or found.exception() is not None:
            with self._lock:
                self._pending = None
                self.said = "gains are no longer judged: those before stay"
            return
        result = found.result()
        setpoint = Setpoint(**self._message, stiffness=result.gains.stiffness, damping=result.gains.damping)
        with self._lock:
            self._gains, self._newest = result.gains, setpoint
            if result.why:
                self.said = result.why
                self.counts = self.counts._replace(reduced=self.counts.reduced + 1)
            self._pending = None
            if not (self._closed or result.asked.same(self._wanted)):
                self._judge()
