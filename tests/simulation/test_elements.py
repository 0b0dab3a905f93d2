"""What touches a robot gives nothing of its own, and the plant books all that passes its ports."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

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


def balance(element: AbstractElement, seed: int) -> tuple[float, float, float]:
    """Return the power through the port, plus the loss, plus the rate of what is stored; the loss; and their size.

    The rate is the derivative of what is stored along the motion of motors and end effector, and of its own state.
    """
    rng = np.random.default_rng(seed)
    m, s = (numbers(layout, rng) for layout in (element.parameters(N), element.inputs()))
    speed = 10 ** rng.uniform(-6, 1)
    dq, dtheta = (cs.SX(rng.normal(size=N) * speed) for _ in range(2))
    velocity, spin = (cs.SX(rng.normal(size=3) * speed) for _ in range(2))
    own, layout = element.state(N).symbols("own")[0], element.state(N)
    sizes = {"q": (N, 1), "theta": (N, 1), "position": (3, 1), "rotation": (3, 3)}
    at = {name: cs.SX.sym(name, *size) for name, size in sizes.items()}
    state = SimpleNamespace(q=at["q"], theta=at["theta"], dq=dq, dtheta=dtheta)
    touch = Touch(state, velocity, spin, at["position"], at["rotation"], layout.view(own))
    effect = element.act(touch, _expressions(s), _expressions(m))
    places = cs.vertcat(at["q"], at["theta"], at["position"], cs.vec(at["rotation"]), own)
    turning = at["rotation"] @ cs.skew(spin)
    moving = cs.vertcat(dq, dtheta, at["rotation"] @ velocity, cs.vec(turning), effect.rate)
    rate = cs.jtimes(effect.stored, places, moving)
    given = cs.dot(effect.motor, dtheta) + cs.dot(effect.force, velocity) + cs.dot(effect.moment, spin)
    there = np.concatenate([rng.normal(size=2 * N + 3), _turned(rng).ravel(), rng.normal(size=layout.size)])
    f = cs.Function("f", [places], [given, effect.lost, rate])
    parts = [float(value) for value in f(there)]
    return sum(parts), parts[1], sum(map(abs, parts))


def _turned(rng: np.random.Generator) -> np.ndarray:
    return Rotation.random(random_state=rng).as_matrix()


def _expressions(values: dict[str, np.ndarray]) -> SimpleNamespace:
    return SimpleNamespace(**{name: cs.SX(value) for name, value in values.items()})


def require_honest(element: AbstractElement) -> None:
    for seed in range(200):
        left, lost, size = balance(element, seed)
        assert lost >= 0
        assert abs(left) <= 1e-13 * size


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
