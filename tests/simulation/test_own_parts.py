"""Parts that somebody brings: a law, a tank, an element; in place of those of a scenario, from outside the package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as cs
import numpy as np
import pytest
from numpy.typing import ArrayLike

import passiflex as pf
from passiflex.control.gravity import AbstractGravity, RobotGravity
from passiflex.control.law import AbstractLaw, Array, ImpedanceLaw
from passiflex.control.motion import Motion, Pose, hold
from passiflex.control.signals import Command, Measurement, Reference, Stored
from passiflex.control.task import AbstractTask
from passiflex.diagrams import ideal_motion
from passiflex.elements import AbstractElement, Effect, Touch, nothing
from passiflex.errors import ArgumentError, NameUnknownError, SizeError, ValueRangeError
from passiflex.layout import Field, Layout
from passiflex.problems.own_parts import with_parts
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.rest import Remembered, Rest
from passiflex.sampled.sensors import AbstractSensorEffect, Reading
from passiflex.sampled.tank import AbstractTank, PeriodFlows
from passiflex.sampled.tanks import PortTank
from passiflex.scenarios.reference import AbstractReferenceEvent
from passiflex.simulation import Run, resolve, salvage
from passiflex.stability.linear_loop import LinearLoop
from worlds import world

PUSH = [{"from": 0.05, "to": 0.15, "force": [0, 0, 10]}]
SHORT: dict[str, Any] = {"forces": PUSH, "duration": 0.3}


class Leaking(AbstractTank):
    """The port tank, less a tenth of all that comes in."""

    kind, title, reads = "leaking", "leaking tank", PortTank.reads
    measures = falls_back = True

    def flow(self, flows: PeriodFlows, g: SimpleNamespace) -> cs.SX:
        flow = -flows.storage_change - flows.port_energy
        return flow - cs.fmax(flow, 0) / 10


@dataclass(frozen=True)
class Brush(AbstractElement):
    """A drag along the motion of the end effector that grows with its speed."""

    strength: float

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        drag = self.strength * cs.norm_2(cs.vertcat(at.velocity, 1e-6)) * at.velocity
        return nothing(at.x.q.numel())._replace(force=-drag, lost=cs.dot(drag, at.velocity))


@dataclass(frozen=True, eq=False)
class Braked(AbstractLaw):
    """The paper's law with a brake on the shaped motors, of a gain of its own."""

    inner: ImpedanceLaw
    has_tank = True
    shapes = True

    @property
    def robot(self) -> FlexibleJointRobot:  # type: ignore[override]
        return self.inner.robot

    @property
    def task(self) -> AbstractTask:  # type: ignore[override]
        return self.inner.task

    @property
    def gravity(self) -> AbstractGravity:  # type: ignore[override]
        return self.inner.gravity

    @property
    def layout(self) -> Layout:
        return self.inner.layout + Layout((Field("brake", (), "N m s/rad"),))

    def command(
        self, y: Measurement, reference: Reference, m: SimpleNamespace, g: SimpleNamespace, added: Any = 0.0
    ) -> Command:
        moving = self.inner.stored(y, m, g).dphi
        return self.inner.command(y, reference, m, g, added - g.brake * moving)

    def stored(self, y: Measurement, m: SimpleNamespace, g: SimpleNamespace) -> Stored:
        return self.inner.stored(y, m, g)

    def posture_at_rest(self, q: Array, theta: Array, K: Array, gains: Mapping[str, ArrayLike]) -> Array:
        return self.inner.posture_at_rest(q, theta, K, gains)

    def motors(self, m: SimpleNamespace, g: SimpleNamespace) -> cs.SX:
        return self.inner.motors(m, g)


def braked(robot: str = "planar2r") -> Braked:
    of = resolve(world()).law
    return Braked(ImpedanceLaw(FlexibleJointRobot.load(robot), of.task, RobotGravity()))


def test_a_tank_of_ones_own_keeps_its_own_books() -> None:
    scenario = world(**SHORT)
    ours, theirs = pf.simulate(scenario, tank=Leaking()), pf.simulate(scenario)
    assert pf.audit(ours).verdict == "passive"
    assert ours["refilled_energy"][-1] < 0.95 * theirs["refilled_energy"][-1]
    np.testing.assert_allclose(ours["q"], theirs["q"], atol=1e-12)  # as long as it is not empty


@pytest.mark.parametrize("strength", [5.0, 50.0])
def test_an_element_of_ones_own_takes_energy_out(strength: float) -> None:
    scenario = world(**SHORT)
    ours, theirs = pf.simulate(scenario, elements=[Brush(strength)]), pf.simulate(scenario)
    assert pf.audit(ours).verdict == "passive"
    assert np.abs(ours["dq"]).max() < np.abs(theirs["dq"]).max()
    assert abs(pf.audit(ours).ledger_residual) < 1e-6
    none = pf.simulate(scenario, elements=[Brush(0.0)])
    np.testing.assert_allclose(none["q"], theirs["q"], atol=1e-12)


@pytest.mark.parametrize("control", ["sampled", "continuous"])
def test_a_law_of_ones_own_has_gains_of_its_own(control: str) -> None:
    without = {} if control == "sampled" else {"control": None, "tank": None, "noise": None}
    scenario = world(**SHORT, **without)
    plain = pf.simulate(scenario)
    same = pf.simulate(scenario, law=braked(), gains={"brake": 0.0})
    np.testing.assert_allclose(same["q"], plain["q"], atol=1e-9)
    slow = pf.simulate(scenario, law=braked(), gains={"brake": 20.0})
    assert np.abs(slow["dphi"]).max() < 0.9 * np.abs(plain["dphi"]).max()
    assert slow.data.attrs["law"] == "Braked"
    assert slow.data.attrs["scenario"].startswith("# With parts that no scenario has: Braked.\n")
    assert pf.Run(slow.data).name == scenario.name


def test_what_does_not_fit_is_said() -> None:
    problem = resolve(world())
    still = resolve(world(control=None, tank=None, noise=None))

    @dataclass(frozen=True)
    class Scheduled(Brush):
        def inputs(self) -> Layout:
            return Layout((Field("bristles", (), "1"),))

    @dataclass(frozen=True)
    class Stray(Brush):
        def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
            return nothing(at.x.q.numel())._replace(motor=-at.x.dtheta, lost=cs.sumsqr(at.x.dtheta))

    @dataclass(frozen=True)
    class Hoard(Brush):
        def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
            return nothing(at.x.q.numel())._replace(stored=cs.sumsqr(at.position))

    matched = resolve(world(control={"inner_loop": "matched"}))
    for wrong, error, message in (
        (lambda: with_parts(problem, tank=Leaking), ArgumentError, "an instance of AbstractTank"),
        (lambda: with_parts(problem, law="mine"), ArgumentError, "an instance of AbstractLaw"),
        (lambda: with_parts(problem, elements=Brush(1.0)), ArgumentError, "a list of elements"),
        (lambda: with_parts(problem, elements=[Brush]), ArgumentError, "an instance of AbstractElement"),
        (
            lambda: with_parts(matched, law=braked(), gains={"brake": 1.0}),
            ValueRangeError,
            "the law cannot be matched; got Braked; needs `inner_loop: plain`",
        ),
        (lambda: with_parts(problem, law=braked("iiwa14")), ValueRangeError, "for another robot; got iiwa14"),
        (lambda: with_parts(problem, law=braked()), SizeError, "parameter 'brake' is missing"),
        (lambda: with_parts(problem, law=braked(), gains={"brak": 1.0}), NameUnknownError, "try 'brake'"),
        (lambda: with_parts(problem, gains={"brake": 1.0}), ValueRangeError, "a law of one's own; got brake"),
        (
            lambda: with_parts(problem, elements=[Scheduled(1.0)]),
            ValueRangeError,
            "has inputs; got Scheduled",
        ),
        (
            lambda: with_parts(problem, elements=[Stray(1.0)]),
            ValueRangeError,
            "more than the end effector; got Stray",
        ),
        (lambda: with_parts(problem, elements=[Hoard(1.0)]), ValueRangeError, "needs stores = True"),
        (
            lambda: with_parts(problem, elements=[Brush(1.0)] * 2),
            ValueRangeError,
            "two .* one name; got brush",
        ),
        (lambda: with_parts(still, tank=Leaking()), ValueRangeError, "is for sampled loops"),
    ):
        with pytest.raises(error, match=message):
            wrong()
    assert with_parts(problem) is problem


@dataclass(frozen=True)
class Warming(AbstractSensorEffect):
    """An offset of τ_a that creeps up, by `rate` [N m/s], from the first reading on."""

    rate: float

    def state(self, n: int) -> Layout:
        return Layout((Field("warming_offset", (), "N m", "of every joint torque sensor"),))

    def read(self, y: Measurement, elapsed: cs.SX, s: SimpleNamespace) -> Reading:
        offset = s.warming_offset + self.rate * elapsed
        return Reading(y._replace(tau_a=y.tau_a + offset), offset)


def test_a_sensor_effect_of_ones_own_has_a_memory() -> None:
    scenario = world(**SHORT)
    ours, theirs = pf.simulate(scenario, sensors=[Warming(2.0)]), pf.simulate(scenario)
    np.testing.assert_allclose(ours["warming_offset"], 2.0 * (ours.time + 1e-3), rtol=1e-9)
    off = ours["measured_tau_a"] - ours["tau_a"]
    np.testing.assert_allclose(off, np.tile(ours["warming_offset"], (2, 1)).T, rtol=0, atol=1e-11)
    assert np.abs(ours["q"] - theirs["q"]).max() > 1e-4
    none = pf.simulate(scenario, sensors=[Warming(0.0)])
    np.testing.assert_allclose(none["q"], theirs["q"], atol=1e-13)
    assert theirs.data.attrs["seed"] == none.data.attrs["seed"]


def test_the_linear_loop_knows_a_sensor_effect() -> None:
    """A slow pole in the torque readings takes a loop that holds to where it does not; and the judge says so."""

    @dataclass(frozen=True)
    class Slow(AbstractSensorEffect):
        pole: float

        def state(self, n: int) -> Layout:
            return Layout((Field("slow_tau_a", (n,), "N m", acts=True, kept=False),))

        def start(self, at: Rest) -> Remembered:
            return {"slow_tau_a": at.running * at.tau_a}

        def read(self, y: Measurement, elapsed: cs.SX, s: SimpleNamespace) -> Reading:
            slow = s.slow_tau_a + (1 - cs.exp(-self.pole * elapsed)) * (y.tau_a - s.slow_tau_a)
            return Reading(y._replace(tau_a=slow), slow)

    problem = resolve(world(law={"shaped_inertia": {"ratio": 0.1}}))
    built_in = resolve(
        world(law={"shaped_inertia": {"ratio": 0.1}}, sensors={"torque_bandwidth": 100 / (2 * np.pi)})
    )
    slow = with_parts(problem, sensors=[Slow(100.0)])
    assert LinearLoop(problem).radius() < 1
    assert LinearLoop(slow).radius() == pytest.approx(LinearLoop(built_in).radius(), rel=1e-6)
    assert LinearLoop(with_parts(problem, sensors=[Slow(1e6)])).radius() == pytest.approx(
        LinearLoop(problem).radius(), abs=1e-6
    )


class Zigzag(AbstractReferenceEvent):
    """There and back, along an axis, with the frequency of a tremor."""

    size: float
    frequency: float

    def build(self, now: Pose) -> Motion:
        return hold(now) | {
            "sine": np.array([0, 0, self.size]),
            "frequency": np.asarray(2 * np.pi * self.frequency),
        }

    def words(self) -> str:
        return f"zigzag of {self.size:g} m"


@pytest.mark.parametrize("control", ["sampled", "continuous"])
def test_a_motion_of_ones_own(control: str) -> None:
    """It begins where the reference is by then, and what the scenario does later goes on from there."""
    without = {} if control == "sampled" else {"control": None, "tank": None, "noise": None}
    steps = {"reference": [{"at": at, "kind": "step", "by": [0, 0, 0.01]} for at in (0.1, 0.4)]}
    scenario = world(duration=0.5, **steps, **without)
    own = pf.simulate(scenario, reference=[Zigzag(at=0.2, size=0.01, frequency=4.0)])
    plain, z = pf.simulate(scenario), own["desired_position"][:, 2]
    before, during, after = own.time < 0.2, (own.time > 0.2) & (own.time < 0.4), own.time > 0.4001
    np.testing.assert_allclose(z[before], plain["desired_position"][before, 2], atol=1e-12)
    moved = 0.01 * np.sin(2 * np.pi * 4.0 * (own.time[during] - 0.2))
    np.testing.assert_allclose(z[during] - plain["desired_position"][during, 2], moved, atol=1e-12)
    left = 0.01 * np.sin(2 * np.pi * 4.0 * 0.2)  # 9.5 mm below where the scenario alone would be
    np.testing.assert_allclose(z[after], plain["desired_position"][after, 2] + left, atol=1e-12)
    with pytest.raises(ValueRangeError, match="when no other motion begins"):
        pf.simulate(scenario, reference=[Zigzag(at=0.4, size=0.01, frequency=5.0)])


@pytest.mark.parametrize("way", ["sampled", "continuous"])
@pytest.mark.parametrize("name", ["Tank", "Drawn", "Cartesian_Spring", "External"])
def test_a_part_is_not_called_as_a_signal_is(name: str, way: str) -> None:
    """Its books would take the place of the signal in the run."""
    called = dataclass(frozen=True)(type(name, (Brush,), {"__annotations__": {"strength": float}}))
    still = {} if way == "sampled" else {"control": None, "tank": None, "noise": None}
    with pytest.raises(ValueRangeError, match=r"two (signals|fields) of one name; got"):
        with_parts(resolve(world(**still)), elements=[called(1.0)])


def test_a_part_that_cannot_be_hashed_is_said() -> None:
    act = {"act": Brush.act, "__annotations__": {"strength": float}}
    loose = dataclass(type("Loose", (AbstractElement,), act))
    with pytest.raises(ArgumentError, match=r"can be hashed.*try @dataclass"):
        with_parts(resolve(world()), elements=[loose(1.0)])


@dataclass(frozen=True)
class Bob(AbstractElement):
    """A mass of its own on a spring, with a state along the axes of space."""

    stores: ClassVar[bool] = True

    def state(self, n: int) -> Layout:
        axes: tuple[str, ...] = ("axis",)
        return Layout((Field("bob", (3,), "m", axes=axes), Field("bob_speed", (3,), "m/s", axes=axes)))

    def start(self, at: Pose, n: int) -> dict[str, Any]:
        return {"bob": at.position, "bob_speed": np.zeros(3)}

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        stretch, speed = at.position - at.own.bob, at.rotation @ at.velocity - at.own.bob_speed
        pull = 50 * stretch + 3 * speed
        stored = 25 * cs.sumsqr(stretch) + cs.sumsqr(at.own.bob_speed) / 4
        none = nothing(at.x.q.numel())
        return none._replace(
            force=-at.rotation.T @ pull,
            lost=3 * cs.sumsqr(speed),
            stored=stored,
            rate=cs.vertcat(at.own.bob_speed, 2 * pull),
        )


def test_a_run_with_parts_of_ones_own_goes_wherever_a_run_goes(tmp_path: Path) -> None:
    """To a file, to what reads it damaged or not, to a page; and is held against no ideal that knows none of them."""
    parts: dict[str, Any] = {"elements": [Bob()], "reference": [Zigzag(at=0.2, size=0.01, frequency=4.0)]}
    scenario = world(**SHORT)
    run, plain = pf.simulate(scenario, **parts), pf.simulate(scenario)
    read, notices = salvage(run.save(tmp_path / "run.nc"))
    assert notices == ()
    for again in (read, Run.load(tmp_path / "run.nc")):
        assert again.own_parts == run.own_parts == "Bob, Zigzag"
        assert again.elements == run.elements
        np.testing.assert_array_equal(again["bob"], run["bob"])
        assert pf.audit(again).ledger_residual == pf.audit(run).ledger_residual < 1e-6
    assert plain.own_parts == ""
    assert ideal_motion(plain) is not None
    assert ideal_motion(run) is None
    page = run.show(tmp_path / "run.html", compare=[plain]).read_text(encoding="utf-8")
    assert "Bob, Zigzag" in page


@dataclass(frozen=True)
class Bristles(AbstractElement):
    """The brush, whose strength is a run-time number: another one needs no other code."""

    strength: float

    @property
    def structure(self) -> type:
        return type(self)

    def parameters(self, n: int) -> Layout:
        return Layout((Field("bristles", (), "N s^2/m^2"),))

    def numbers(self, n: int) -> dict[str, ArrayLike]:
        return {"bristles": self.strength}

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        drag = m.bristles * cs.norm_2(cs.vertcat(at.velocity, 1e-6)) * at.velocity
        return nothing(at.x.q.numel())._replace(force=-drag, lost=cs.dot(drag, at.velocity))


@pytest.mark.parametrize("way", ["sampled", "continuous"])
@pytest.mark.parametrize("strength", [5.0, 50.0])
def test_an_element_has_numbers_of_its_own(way: str, strength: float) -> None:
    still = {} if way == "sampled" else {"control": None, "tank": None, "noise": None}
    scenario = world(**SHORT, **still)
    ours, theirs = (pf.simulate(scenario, elements=[kind(strength)]) for kind in (Bristles, Brush))
    np.testing.assert_allclose(ours["q"], theirs["q"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours["bristles_energy"], theirs["brush_energy"], atol=1e-9)
