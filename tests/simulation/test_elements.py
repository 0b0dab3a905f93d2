"""What touches a robot gives nothing of its own, and the plant books all that passes its ports."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings

from arms import serial_chains
from loops import SEEDS, with_joints
from passiflex.elements import AbstractElement, Drag, Effect, MotorFriction, Touch, nothing
from passiflex.layout import Field, Layout
from passiflex.loops.plant import ELEMENTS, Plant
from passiflex.robots.chain import SerialChain
from passiflex.robots.flexible import FlexibleJointRobot

N = 3


def numbers(layout: Layout, rng: np.random.Generator) -> dict[str, np.ndarray]:
    return {f.name: rng.uniform(0, 5, f.shape) + 1e-2 * f.name.endswith("width") for f in layout}


def balance(element: AbstractElement, seed: int) -> tuple[float, float]:
    """Return the power through the port plus the loss, and the loss."""
    rng = np.random.default_rng(seed)
    m, s = (numbers(layout, rng) for layout in (element.parameters(N), element.inputs()))
    speed = 10 ** rng.uniform(-6, 1)
    parts = [cs.SX(rng.normal(size=N) * scale) for scale in (1, 1, speed, speed)]
    vectors = [cs.SX(rng.normal(size=3) * speed) for _ in range(2)]
    at = Touch(_state(parts), *vectors, cs.SX(rng.normal(size=3)), cs.SX.eye(3), SimpleNamespace())
    effect = element.act(at, _expressions(s), _expressions(m))
    at_tip = cs.dot(effect.force, at.velocity) + cs.dot(effect.moment, at.spin)
    given = cs.dot(effect.motor, at.x.dtheta) + at_tip
    return float(given + effect.lost), float(effect.lost)


def _state(parts: list[cs.SX]) -> Any:
    return SimpleNamespace(q=parts[0], theta=parts[1], dq=parts[2], dtheta=parts[3])


def _expressions(values: dict[str, np.ndarray]) -> SimpleNamespace:
    return SimpleNamespace(**{name: cs.SX(value) for name, value in values.items()})


def require_honest(element: AbstractElement) -> None:
    for seed in range(200):
        left, lost = balance(element, seed)
        assert lost >= 0
        assert abs(left) <= 1e-13 * lost


@pytest.mark.parametrize("element", ELEMENTS, ids=lambda e: type(e).__name__)
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
    true = {signal.field.name: signal.value for signal in plant.true(state, s, m)}
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
