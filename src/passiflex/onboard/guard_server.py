"""A guard for another process: messages in msgpack over ZeroMQ, on the loopback only, from one writer at a time."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

from passiflex.errors import PassiflexError, ValueRangeError
from passiflex.extras import imported
from passiflex.onboard.guard import Guard
from passiflex.onboard.setpoint import Setpoint

LOOPBACK = "tcp://127.0.0.1"
LARGEST = 1 << 16
"""Longest message [bytes]; one with everything has a few thousand."""
LOOK = 0.05
"""How long the server waits for a message before it looks whether it is to end [s]."""
SILENCE = 1.0
"""After so long without a message of the writer another may write [s]."""


class GuardServer:
    """Serves a guard in a thread of its own.

        with pf.GuardServer(guard) as server: ...
        print(server.address)

    A message is a mapping with entries as a `Setpoint` has them, arrays as lists; its answer has `said`, why it was
    refused, and `status`: level of the tank, why something is held back. The first who sends is the writer; others are
    refused until nothing came from it for a second. Silence is the watch's: the reference stands still, then the
    stiffness goes.

    Parameters
    ----------
    port: On the loopback; 0 takes a free one.

    Raises
    ------
    MissingExtraError
        If ZeroMQ or msgpack is not there.
    ValueRangeError
        If nothing can be served at the port.
    """

    def __init__(self, guard: Guard, port: int = 0):
        self._zmq, self._msgpack = _libraries()
        self.guard, self._writer, self._heard = guard, b"", -math.inf
        self._context = self._zmq.Context()
        self._socket = self._context.socket(self._zmq.ROUTER)
        self._socket.setsockopt(self._zmq.MAXMSGSIZE, LARGEST)
        self._socket.setsockopt(self._zmq.LINGER, 0)
        try:
            self._socket.bind(f"{LOOPBACK}:{port or '*'}")
        except self._zmq.ZMQError as error:
            self._context.destroy()
            raise ValueRangeError("nothing can be served there", got=f"port {port}: {error}") from error
        self.address: str = self._socket.getsockopt_string(self._zmq.LAST_ENDPOINT)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="passiflex guard", daemon=True)
        self._thread.start()

    def __enter__(self) -> GuardServer:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """End the thread; the guard goes on."""
        self._ends.set()
        self._thread.join()
        self._context.destroy(linger=0)

    def _serve(self) -> None:
        while not self._ends.is_set():
            if not self._socket.poll(int(1e3 * LOOK)):
                continue
            who, *frames = self._socket.recv_multipart()
            try:
                answer = self._answered(who, frames[-1] if frames else b"")
            except Exception as error:  # an arm hangs on this thread
                answer = {"said": f"refused: {type(error).__name__}: {error}", "status": self._status()}
            self._socket.send_multipart([who, *frames[:-1], self._msgpack.packb(answer)])

    def _answered(self, who: bytes, packed: bytes) -> dict[str, Any]:
        now = time.monotonic()
        if who != self._writer and now - self._heard < SILENCE:
            return {"said": "refused: somebody else is writing", "status": self._status()}
        self._writer, self._heard = who, now
        try:
            message = self._msgpack.unpackb(packed)
        except Exception as error:  # the reader raises many kinds for what it cannot read
            return {"said": f"refused: no msgpack: {type(error).__name__}", "status": self._status()}
        if not isinstance(message, dict) or not all(isinstance(name, str) for name in message):
            return {"said": "refused: no mapping of names", "status": self._status()}
        return {"said": self.guard.send(**message), "status": self._status()}

    def _status(self) -> dict[str, Any]:
        """Return what the controller says of its last period; what is no number is None."""
        report = self.guard.controller.report
        numbers = {name: float(v) for name, v in report._asdict().items() if name != "why"}
        told: dict[str, Any] = {name: v if math.isfinite(v) else None for name, v in numbers.items()}
        return told | {"why": report.why, "gains": self.guard.said}


class GuardClient:
    """Sends messages to a server; `send` returns its answer.

    Parameters
    ----------
    address: Of the server, as `server.address`.
    timeout: How long it waits for an answer [s].

    Raises
    ------
    MissingExtraError
        If ZeroMQ or msgpack is not there.
    """

    def __init__(self, address: str, timeout: float = 1.0):
        self._zmq, self._msgpack = _libraries()
        self._context = self._zmq.Context()
        self._socket = self._context.socket(self._zmq.DEALER)
        self._socket.setsockopt(self._zmq.LINGER, 0)
        self._socket.connect(address)
        self._timeout = timeout

    def __enter__(self) -> GuardClient:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._context.destroy(linger=0)

    def send(self, /, **message: Any) -> dict[str, Any]:
        """Send a message with entries as a `Setpoint` has them, and return the answer.

        Raises
        ------
        PassiflexError
            If none comes in time.
        """
        asked = Setpoint(**message)  # what is none is not even sent
        packed = {name: value.tolist() for name in message if (value := getattr(asked, name)) is not None}
        while self._socket.poll(0):  # an answer that came too late for the message before
            self._socket.recv()
        self._socket.send(self._msgpack.packb(packed))
        if not self._socket.poll(int(1e3 * self._timeout)):
            raise PassiflexError("the guard did not answer", got=f"nothing for {self._timeout:g} s")
        answer: dict[str, Any] = self._msgpack.unpackb(self._socket.recv())
        return answer


def _libraries() -> tuple[Any, Any]:
    purpose = "a guard for other processes"
    return imported("zmq", "guard", purpose), imported("msgpack", "guard", purpose)
