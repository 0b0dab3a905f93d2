"""What touches a robot gives nothing of its own, and the plant books all that passes its ports."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings

from arms import serial_chains
from honest import N, numbers, require_honest
from loops import SEEDS, with_joints
from passiflex.elements import AbstractElement, Drag, Effect, MotorFriction, Touch, nothing
from passiflex.layout import Field, Layout
from passiflex.loops.plant import ELEMENTS, Plant
from passiflex.robots.chain import SerialChain
from passiflex.robots.flexible import FlexibleJointRobot


@dataclass(frozen=True)
class Bob(AbstractElement):
    """A mass of its own, on a spring and a damper at the end effector, and a turned spring that it may lie about."""

    lie: str = ""
    stores: ClassVar[bool] = True

    def state(self, n: int) -> Layout:
        return Layout((Field("bob", (3,), "m"), Field("bob_speed", (3,), "m/s")))

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        stretch, speed = at.position - at.own.bob, at.rotation @ at.velocity - at.own.bob_speed
        pull = 50 * stretch + 3 * speed
        up = at.rotation[:, 2]
        stored = 25 * cs.sumsqr(stretch) + cs.sumsqr(at.own.bob_speed) / 4 - 2 * up[2]
        turning = at.rotation.T @ cs.cross(up, cs.DM([0, 0, 2]))
        return nothing(N)._replace(
            force=-at.rotation.T @ pull,
            moment=turning if self.lie != "turns" else -turning,
            lost=3 * cs.sumsqr(speed),
            stored=1.1 * stored if self.lie == "boasts" else stored,
            rate=cs.vertcat(at.own.bob_speed, (1 if self.lie == "is heavier" else 2) * pull),
        )


@pytest.mark.parametrize("element", [*ELEMENTS, Bob()], ids=lambda e: type(e).__name__)
def test_an_element_gives_nothing_of_its_own(element: AbstractElement) -> None:
    require_honest(element)


@dataclass(frozen=True)
class Liar(AbstractElement):
    """A drag that pushes, or says that it lost less than it took."""

    how: str

    def parameters(self, n: int) -> Layout:
        return Layout(())

    def inputs(self) -> Layout:
        return Layout((Field("push", (), "N s/m"),))

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        v = at.velocity
        force = {"pushes": s.push * v, "hides": -s.push * v, "forgets the moment": cs.SX.zeros(3)}[self.how]
        lost = {"pushes": -s.push * cs.dot(v, v), "hides": cs.SX(0), "forgets the moment": cs.SX(0)}[self.how]
        moment = s.push * at.spin if self.how.startswith("forgets") else cs.SX.zeros(3)
        return nothing(N)._replace(force=force, moment=moment, lost=lost)


@pytest.mark.parametrize("lie", ["turns", "boasts", "is heavier"])
def test_an_element_that_lies_of_what_it_stores_is_found(lie: str) -> None:
    with pytest.raises(AssertionError):
        require_honest(Bob(lie))


@pytest.mark.parametrize("how", ["pushes", "hides", "forgets the moment"])
def test_an_element_that_lies_is_found(how: str) -> None:
    with pytest.raises(AssertionError):
        require_honest(Liar(how))


@settings(max_examples=15, deadline=None)
@given(serial_chains(1, 5), SEEDS)
def test_what_passes_the_ports_is_what_the_robot_stores_and_loses(chain: SerialChain, seed: int) -> None:
    """Ḣ = external + motor − lost, with H from the signals of the plant, differentiated along its own vector field."""
    rng, plant = np.random.default_rng(seed), Plant(with_joints(chain, seed))
    n = chain.n
    state, u = cs.SX.sym("x", 4 * n), cs.SX.sym("u", n + plant.environment.size)
    p, m = plant.parameters.symbols("p")
    x, s = plant.view(state), plant.environment.view(u[n:])
    true = {signal.field.name: signal.value for signal in plant.true(state, s, m).signals}
    parts = ("link_kinetic", "motor_kinetic", "joint_spring", "potential")
    energy = sum(true[f"{part}_energy"] for part in parts)
    slope, powers = plant.rhs(state, u, p)
    rate = cs.jtimes(energy, state, slope)
    tau_e = cs.dot(true["tau_e"], x.dq)
    f = cs.Function("f", [state, u, p], [rate, powers, tau_e])
    values = plant.robot.nominal() | numbers(MotorFriction().parameters(n), rng)
    told = (
        np.concatenate([rng.normal(size=4 * n)]),
        np.concatenate([rng.normal(size=n + 6), rng.uniform(0, 5, 2)]),
    )
    rate, powers, by_torque = f(*told, plant.parameters.pack(values))
    named = plant.energies.unpack(np.array(powers).ravel())
    supplied = named["external"] + named["motor"]
    lost = named["joint_loss"] + named["friction"]
    scale = sum(abs(value) for value in named.values())
    assert float(rate) == pytest.approx(supplied - lost, abs=1e-9 * scale)
    assert float(by_torque) == pytest.approx(named["external"], abs=1e-11 * scale)


def test_a_plant_has_the_numbers_of_what_touches_it() -> None:
    robot = FlexibleJointRobot.load("planar2r")
    bare, touched = Plant(robot, ()), Plant(robot)
    assert bare.parameters == robot.layout
    assert [f.name for f in bare.energies] == ["external", "motor", "joint", "joint_loss"]
    assert [f.name for f in bare.environment] == ["F_e"]
    extra = {f.name for f in touched.parameters} - {f.name for f in bare.parameters}
    assert extra == {"coulomb_friction", "viscous_friction", "friction_width"}
    assert {f.name for f in touched.environment} == {"F_e", *(f.name for f in Drag().inputs())}
    assert [f.name for f in touched.energies][-3:] == ["friction", "drag", "drag_given"]
    resting = Plant(robot, (MotorFriction(acts=False), Drag(acts=False)))
    assert [f.name for f in resting.energies][-1] == "friction"
