"""A guard for another process: whatever bytes come, it answers in words and goes on."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from onboard.arms import ElasticArm
from onboard.test_controller import ALL, START, planar
from passiflex.errors import PassiflexError, ValueRangeError
from passiflex.onboard import Controller, Guard, GuardClient, GuardServer, WatchSettings, guard_server

zmq = pytest.importorskip("zmq")
msgpack = pytest.importorskip("msgpack")


@pytest.fixture(scope="module")
def server() -> Iterator[GuardServer]:
    controller = Controller(planar(), WatchSettings(frozen_after=np.inf, soft_start=0))
    controller.start(ElasticArm("planar2r", START).said(*ALL))
    with Guard(controller) as guard, GuardServer(guard) as server:
        yield server


def patient(server: GuardServer) -> GuardClient:
    """Return a client that waits for as long as a loaded machine may take."""
    return GuardClient(server.address, timeout=30)


@pytest.fixture(autouse=True)
def _nobody_writes(server: GuardServer) -> None:
    server._heard = -np.inf


def test_a_message_of_another_process_reaches_the_loop(server: GuardServer) -> None:
    with patient(server) as client:
        answer = client.send(position=[0.5, 0, 0.6], stiffness=[150, 150, 150])
        assert answer["said"] == ""
        assert answer["status"]["level"] == pytest.approx(2)
        server.guard.wait()
        taken = server.guard.take()
        assert taken is not None
        np.testing.assert_array_equal(taken.position, [0.5, 0, 0.6])
        np.testing.assert_array_equal(taken.stiffness, 150 * np.eye(3))
        with pytest.raises(ValueRangeError, match="finite"):
            client.send(position=[0, 0, np.nan])
        assert "needs shape (3, 3)" in client.send(stiffness=np.eye(6))["said"]


def test_one_writes_at_a_time(server: GuardServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard_server, "SILENCE", 1000.0)
    with patient(server) as first, patient(server) as second:
        assert first.send(position=[0.5, 0, 0.5])["said"] == ""
        assert second.send(position=[0.6, 0, 0.5])["said"] == "refused: somebody else is writing"
        server._heard -= 2000
        assert second.send(position=[0.6, 0, 0.5])["said"] == ""
        assert first.send(position=[0.5, 0, 0.5])["said"] == "refused: somebody else is writing"


def raw(server: GuardServer, packed: bytes) -> dict[str, Any]:
    with zmq.Context() as context, context.socket(zmq.DEALER) as peer:
        peer.setsockopt(zmq.LINGER, 0)
        peer.connect(server.address)
        peer.send(packed)
        assert peer.poll(30_000), "no answer"
        answer: dict[str, Any] = msgpack.unpackb(peer.recv())
        return answer


@pytest.mark.parametrize(
    "packed",
    [
        b"",
        b"\xc1",
        b"hello",
        msgpack.packb([1, 2]),
        msgpack.packb({"position": "there"}),
        msgpack.packb({"position": [float("nan")] * 3}),
        msgpack.packb({"position": {"x": 1}}),
        msgpack.packb({"stiffness": [[1, 2, 3]]}),
        msgpack.packb({"self": 1}),
        msgpack.packb({"": [0, 0, 0]}),
        msgpack.packb({"position": [1e308, 0, 0], "velocity": None, "rotation": [0, 0, 0, 0]}),
        b"\x81\xa8position" + b"\x91" * 600,
    ],
)
def test_what_is_no_message_is_refused_in_words(server: GuardServer, packed: bytes) -> None:
    server.guard.take()
    assert raw(server, packed)["said"].startswith("refused: ")
    assert server.guard.take() is None


def test_a_search_of_bytes(server: GuardServer) -> None:
    """Whole messages with bytes changed, cut and doubled: each is answered, and what passes is a setpoint."""
    rng = np.random.default_rng(0)
    whole = msgpack.packb(
        {"position": [0.5, 0.0, 0.5], "stiffness": [100.0, 100.0, 100.0], "wrench": [0.0] * 6}
    )
    with zmq.Context() as context, context.socket(zmq.DEALER) as peer:
        peer.setsockopt(zmq.LINGER, 0)
        peer.connect(server.address)
        for _ in range(1500):
            changed = bytearray(whole)
            for _ in range(rng.integers(1, 6)):
                changed[rng.integers(len(changed))] = rng.integers(256)
            peer.send(bytes(changed[: rng.integers(1, len(changed) + 1)]))
            assert peer.poll(30_000)
            said = msgpack.unpackb(peer.recv())["said"]
            taken = server.guard.take()
            assert said == "" or said.startswith("refused: ")
            assert (
                said == "" or taken is None or taken.stiffness is not None
            )  # gains that were judged meanwhile
    server.guard.wait()


def test_a_message_that_is_too_long_is_not_read(server: GuardServer) -> None:
    """Its writer is cut off, which ZeroMQ mends; the server goes on."""
    with GuardClient(server.address, timeout=0.3) as client:
        client._socket.send(b"x" * (guard_server.LARGEST + 1))
        with suppress(PassiflexError):
            client.send(position=[0.5, 0, 0.5])
    server._heard = -np.inf
    with patient(server) as client:
        assert client.send(position=[0.5, 0, 0.5])["said"] == ""


def test_it_is_on_the_loopback_alone(server: GuardServer) -> None:
    assert server.address.startswith("tcp://127.0.0.1:")
    with pytest.raises(ValueRangeError, match="nothing can be served there"):
        GuardServer(server.guard, int(server.address.rpartition(":")[2]))


def test_who_does_not_answer_is_said() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with (
            GuardClient(address, timeout=0.1) as client,
            pytest.raises(PassiflexError, match="did not answer"),
        ):
            client.send(position=[0, 0, 0])
