"""Parts of somebody's own with a mistake in them: each is found before anything is compiled, by part and method."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as cs
import numpy as np
import pytest

import passiflex as pf
from passiflex.control.gravity import RobotGravity, StaticGravity
from passiflex.control.law import AbstractLaw
from passiflex.control.signals import Command, LawEnergy, Measurement, Stored
from passiflex.control.task import PositionTask
from passiflex.elements import AbstractElement, Effect, Touch, nothing
from passiflex.errors import PassiflexError, PassiflexWarning
from passiflex.layout import Field, Layout
from passiflex.passivity.extremes import extremes_of_rows
from passiflex.problems.own_parts import with_parts
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.sensors import AbstractSensorEffect, Reading
from passiflex.sampled.tank import AbstractTank
from passiflex.scenarios.reference import AbstractReferenceEvent
from passiflex.simulation import resolve
from worlds import world

SHORT: dict[str, Any] = {"forces": [{"from": 0.05, "to": 0.15, "force": [0, 0, 10]}], "duration": 0.3}
STILL: dict[str, Any] = {"control": None, "tank": None, "noise": None}


def element(act: Callable[..., Any], **attributes: Any) -> AbstractElement:
    made = type("Odd", (AbstractElement,), {"act": act, **attributes})()
    assert isinstance(made, AbstractElement)
    return made


def pushing(**effect: Any) -> AbstractElement:
    return element(lambda self, at, s, m: nothing(at.x.q.numel())._replace(**effect))


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (pushing(force=cs.SX.zeros(4)), "Odd.act: force of its effect; got 4 numbers; needs 3"),
        (pushing(rate=cs.SX.zeros(2)), "Odd.act: rate of its effect; got 2 numbers; needs 0"),
        (pushing(stored=1.0), "needs stores = True"),
        (element(lambda self, at, s, m: None), "Odd.act fails; got TypeError"),
        (element(lambda self, at, s, m: at.own.depth), "Odd.act fails.*no 'depth'; there are none"),
        (
            element(lambda self, at, s, m: nothing(1), port="tip"),
            "Odd.port; got 'tip'; needs 'motors', 'links' or",
        ),
        (element(lambda self, at, s, m: nothing(1), name="my wall"), "Odd.name; got 'my wall'"),
    ],
)
def test_an_effect_that_is_none_is_said(part: AbstractElement, message: str) -> None:
    with pytest.raises(PassiflexError, match=message):
        with_parts(resolve(world()), elements=[part])


def test_an_element_that_gives_what_it_has_not_is_said_and_its_run_too() -> None:
    def gives(lost: float) -> AbstractElement:
        def act(self: Any, at: Touch, s: Any, m: Any) -> Effect:
            power = 3 * cs.sumsqr(at.velocity)
            return nothing(at.x.q.numel())._replace(force=3 * at.velocity, lost=lost * power)

        return element(act)

    for lost, said in ((0.0, "keeps no books"), (-1.0, "loses less than nothing")):
        with pytest.warns(PassiflexWarning, match=f"Odd {said}"):
            run = pf.simulate(world(**SHORT, **STILL), elements=[gives(lost)])
    with pytest.warns(PassiflexWarning):
        run = pf.simulate(world(**SHORT, **STILL), elements=[gives(0.0)])
    assert pf.audit(run).ledger_residual > 100 * pf.audit(run).integration_error


@dataclass(frozen=True)
class Wall(AbstractElement):
    """A sprung wall above, whose face creeps when it is pushed."""

    away: float
    stores: ClassVar[bool] = True

    def state(self, n: int) -> Layout:
        return Layout((Field("face", (), "m"), Field("heat", (), "J")))

    def start(self, at: Any, n: int) -> dict[str, Any]:
        return {"face": at.position[2] + self.away, "heat": 0.0}

    def act(self, at: Touch, s: Any, m: Any) -> Effect:
        deep = cs.fmax(at.position[2] - at.own.face, 0)
        spring, creeping = 3000 * deep, 3000 * deep / 2000
        force = at.rotation.T @ cs.vertcat(0, 0, -spring)
        lost = spring * creeping
        return nothing(at.x.q.numel())._replace(
            force=force, lost=lost, stored=1500 * deep**2, rate=cs.vertcat(creeping, lost)
        )


@pytest.mark.parametrize("away", [0.02, -0.001])
def test_a_state_that_moves_nothing_is_no_instability(away: float) -> None:
    """The face of a wall that is not touched stays where it is, and heat only adds up."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = pf.simulate(world(**SHORT), elements=[Wall(away)])
    assert pf.audit(run).verdict == "passive"


@dataclass(frozen=True, eq=False)
class JointSprings(AbstractLaw):
    """Springs and dampers from each motor to a posture: it has no Cartesian spring."""

    robot: FlexibleJointRobot
    told: bool
    """Whether `stored` knows of the springs."""
    gravity: Any = RobotGravity()
    fields: tuple[str, ...] = ("stiffness", "damping", "regularisation", "pull", "brake", "posture")
    task = PositionTask()
    has_tank = False
    shapes = False

    @property
    def layout(self) -> Layout:
        n, shapes = self.robot.n, {"stiffness": (3, 3), "damping": (3, 3), "regularisation": ()}
        return Layout(tuple(Field(f, shapes.get(f, (n,)), "1") for f in self.fields))

    def spring(self, y: Measurement, g: Any) -> cs.SX:
        return cs.dot(y.theta - g.posture, g.pull * (y.theta - g.posture)) / 2

    def stored(self, y: Measurement, m: Any, g: Any) -> Stored:
        stretch = y.theta - y.q
        own = self.spring(y, g) if self.told else cs.SX(0)
        return Stored(
            y.theta,
            y.dtheta,
            self.robot.arm.pose(y.theta, m),
            cs.dot(y.dtheta, m.motor_inertia * y.dtheta) / 2,
            cs.dot(stretch, m.joint_stiffness * stretch) / 2 + own,
            cs.SX(0),
        )

    def potential(self, at: Stored, reference: Any, stiffness: cs.SX) -> cs.SX:
        return cs.SX(0)

    def command(self, y: Measurement, reference: Any, m: Any, g: Any, added: Any = 0.0) -> Command:
        tau = -g.pull * (y.theta - g.posture) - g.brake * y.dtheta + added
        at, slip = self.stored(y, m, g), y.dtheta - y.dq
        energy = LawEnergy(
            at.motor_kinetic,
            at.joint_spring,
            cs.SX(0) if self.told else self.spring(y, g),
            cs.SX(0),
            cs.dot(slip, m.joint_damping * slip),
            cs.dot(y.dtheta, g.brake * y.dtheta),
            cs.SX(0),
            cs.SX(0),
        )
        return Command(tau, tau, y.theta, y.dtheta, energy)

    def posture_at_rest(self, q: Any, theta: Any, K: Any, gains: Any) -> Any:
        return theta

    def motors(self, m: Any, g: Any) -> cs.SX:
        return m.motor_inertia


def gains(problem: Any) -> dict[str, Any]:
    none = np.zeros((3, 3))
    own = {"pull": np.full(2, 300.0), "brake": np.full(2, 30.0), "posture": problem.q + 0.1}
    return {"stiffness": none, "damping": none, "regularisation": 1e-9, **own}


@pytest.mark.parametrize("way", [{}, STILL], ids=["sampled", "continuous"])
def test_a_law_with_springs_of_its_own_has_the_margin_that_its_rows_have(way: dict[str, Any]) -> None:
    problem = resolve(world(**SHORT, **way))
    law = JointSprings(problem.law.robot, told=True)
    run = pf.simulate(world(**SHORT, **way), law=law, gains=gains(problem))
    audit, rows = pf.audit(run), extremes_of_rows(run)
    assert audit.verdict == "passive"
    assert audit.books_error < (1e-3 if not way else 1e-5)
    assert audit.margin == pytest.approx(rows.margin, rel=1e-3)
    assert audit.margin > 1
    assert np.ptp(run["q"]) > 0.05
    assert "shaped" not in audit.unbooked


def test_what_is_wrong_with_a_law_is_said() -> None:
    problem = resolve(world(**STILL))
    robot, own = problem.law.robot, gains(problem)
    for law, message in (
        (JointSprings(robot, told=False), "claims two different storages; got .* J by its command"),
        (JointSprings(robot, told=True, gravity=StaticGravity()), "differ in who carries the weight"),
        (JointSprings(robot, told=True, fields=("damping", "regularisation")), "lacks a gain.*stiffness"),
    ):
        with pytest.raises(PassiflexError, match=message):
            with_parts(problem, law=law, gains=own)


def test_what_is_wrong_with_tank_sensor_or_motion_is_said() -> None:
    problem = resolve(world())

    def tank(flow: Any, reads: tuple[str, ...] = ()) -> AbstractTank:
        made = type(
            "Odd", (AbstractTank,), {"kind": "odd", "reads": reads, "flow": lambda self, f, g: flow(f, g)}
        )()
        assert isinstance(made, AbstractTank)
        return made

    def sensor(read: Any) -> AbstractSensorEffect:
        made = type("Odd", (AbstractSensorEffect,), {"read": lambda self, y, elapsed, s: read(y, s)})()
        assert isinstance(made, AbstractSensorEffect)
        return made

    class Odd(AbstractReferenceEvent):
        built: Any = None

        def build(self, now: Any) -> Any:
            return self.built

        def words(self) -> str:
            return "odd"

    for parts, message in (
        ({"tank": tank(lambda f, g: cs.SX.nan(1))}, "Odd.flow; got nan; needs a finite number"),
        ({"tank": tank(lambda f, g: cs.SX.zeros(2))}, "Odd.flow; got 2 numbers"),
        ({"tank": tank(lambda f, g: g.tank_flor)}, "Odd.flow fails.*no 'tank_flor'; there are tank_floor"),
        ({"tank": tank(lambda f, g: 0, ("port",))}, "Odd.reads; got port; needs .*port_energy"),
        ({"sensors": [sensor(lambda y, s: y)]}, "Odd.read fails.*needs Reading"),
        ({"sensors": [sensor(lambda y, s: Reading(y, s.drift))]}, "Odd.read fails.*no 'drift'"),
        ({"sensors": [sensor(lambda y, s: Reading(y, cs.SX.zeros(2)))]}, "its state; got 2 numbers; needs 0"),
        (
            {"sensors": [sensor(lambda y, s: Reading(y._replace(tau_a=cs.SX(1)), cs.SX(0, 1)))]},
            "Odd.read: tau_a; got 1 numbers; needs 2",
        ),
        ({"reference": [Odd(at=0.25, built=None)]}, "Odd.build fails"),
        ({"reference": [Odd(at=0.25, built=(("sines", 1.0),))]}, "unknown parameter; got 'sines'"),
    ):
        with pytest.raises(PassiflexError, match=message):
            with_parts(problem, **parts)
