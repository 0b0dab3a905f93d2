"""Sampled controllers as functions of numbers, one period or many in a row, beside their laws alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import SimpleNamespace
from typing import Any

import casadi as cs
import numpy as np

from arms import _chain
from loops import definite, impedance_gains, rotation, with_joints
from passiflex.control import ImpedanceLaw, Measurement, PoseTask, PositionTask, Reference, StaticGravity
from passiflex.control.rigid import RigidImpedanceLaw
from passiflex.layout import Field, Layout
from passiflex.robots.arm import EndEffectorPose
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.actions import action_layout, posture_spring, tracking_wrench
from passiflex.sampled.controller import SampledController
from passiflex.sampled.sensors import UNFILTERED
from passiflex.sampled.signals import ControlParameters, LedgerEntry, Setpoint
from passiflex.sampled.tank import TankEntry
from passiflex.sampled.tanks import PortTank

PERIOD = 1e-3
FULL = 1e6
"""A level [J] that pays for anything, and opens the valve."""
LEVELS = {"floor": 0.1, "low": 0.3, "cap": 1e7, "power": 1e9 / PERIOD, "trip": -1e30, "signed": 1.0}
LEVELS |= {"fill": 1.0, "braking": 100.0}
OFF = {
    "follow_velocity": 0.0,
    "follow_acceleration": 0.0,
    "coulomb_compensation": 0.0,
    "viscous_compensation": 0.0,
    "compensation_width": 1.0,
    "posture_stiffness": 0.0,
    "posture_damping": 0.0,
    "posture": 0.3,
}
LEDGER = Layout(
    tuple(Field({"fault": "tank_fault"}.get(name, name), (), "J") for name in TankEntry._fields)
    + tuple(Field(name, (), "") for name in LedgerEntry._fields[1:])
)
"""`LedgerEntry` with its tank's entry first; `fault` is the period's."""


@dataclass(frozen=True, eq=False)
class Rig:
    """A controller with random gains, and all that it is told in a period as rows of `told`."""

    controller: SampledController

    @property
    def n(self) -> int:
        return self.controller.law.robot.n

    @cached_property
    def told(self) -> Layout:
        n, k = self.n, self.controller.law.task.size
        sizes = dict.fromkeys(Measurement._fields, (n,)) | {"F_e": (6,)}
        sizes |= {"position": (3,), "rotation": (3, 3), "velocity": (6,), "acceleration": (6,)}
        sizes |= {"stiffness": (k, k), "damping": (k, k), "wrench": (6,), "elapsed": (), "given": (n,)}
        return Layout(tuple(Field(name, shape, "") for name, shape in sizes.items()))

    @cached_property
    def period(self) -> cs.Function:
        """Return (state, told, p) → (state, τ_m, ledger)."""
        state = cs.SX.sym("state", self.controller.state.size)
        told, t = self.told.symbols("told")
        y, setpoint = _said(t)
        p = cs.SX.sym("p", self.controller.parameters.size)
        step = self.controller.step(
            y, setpoint, t.elapsed, t.given, state, ControlParameters(**self.controller.parameters.view(p))
        )
        ledger = cs.vertcat(*step.entry.tank, *step.entry[1:])
        outputs = [step.state, step.command.tau_m, ledger]
        return cs.Function("period", [state, told, p], [cs.densify(x) for x in outputs], {"cse": True})

    @cached_property
    def alone(self) -> cs.Function:
        """Return (told, p, added) → τ_m of the law alone with the gains of the setpoint, S without U, U, f(φ), φ̇."""
        law, (told, t) = self.controller.law, self.told.symbols("told")
        p = cs.SX.sym("p", self.controller.parameters.size)
        added, (y, setpoint) = cs.SX.sym("added", self.n), _said(t)
        views = ControlParameters(**self.controller.parameters.view(p))
        gains = SimpleNamespace(**(vars(views.gains) | {"stiffness": t.stiffness, "damping": t.damping}))
        command = law.command(y, Reference(setpoint.pose, setpoint.velocity), views.model, gains, added)
        stored = law.stored(y, views.model, gains)
        potential = law.task.potential(stored.pose, setpoint.pose, t.stiffness)
        outputs = [command.tau_m, stored.energy, potential, *stored.pose, stored.dphi]
        return cs.Function("alone", [told, p, added], [cs.densify(x) for x in outputs], {"cse": True})

    @cached_property
    def actions(self) -> cs.Function:
        """Return (told, p) → the torque of all actions, ungated."""
        law, (told, t) = self.controller.law, self.told.symbols("told")
        p = cs.SX.sym("p", self.controller.parameters.size)
        views, rows = ControlParameters(**self.controller.parameters.view(p)), slice(0, law.task.size)
        m, g, a, (y, setpoint) = views.model, views.gains, views.actions, _said(t)
        stored = law.stored(y, m, g)
        phi, dphi = stored.phi, stored.dphi
        M, J = law.robot.arm.mass_matrix(y.q, m), law.robot.arm.jacobian(y.q, m)[rows, :]
        at_end = law.robot.arm.jacobian(phi, m)
        lead = tracking_wrench(M, J, t.damping, t.velocity[rows], t.acceleration[rows], g.regularisation, a)
        motors = m.motor_inertia if isinstance(law, RigidImpedanceLaw) else g.shaped_inertia
        error = law.task.error(stored.pose, setpoint.pose)
        moving = M + cs.diag(motors)
        pull = posture_spring(moving, at_end[rows, :], error, phi, dphi, g.regularisation, a)
        torque = at_end.T @ t.wrench + at_end[rows, :].T @ lead + pull
        return cs.Function("actions", [told, p], [cs.densify(torque)], {"cse": True})

    def gains(self, seed: int) -> dict[str, np.ndarray]:
        rng, law = np.random.default_rng(seed), self.controller.law
        if isinstance(law, RigidImpedanceLaw):
            k = law.task.size
            names = {"target_inertia": definite(rng, k, 1, 10), "carried_inertia": law.robot.motor_inertia}
            names |= {"stiffness": definite(rng, k, 10, 1000), "damping": definite(rng, k, 1, 100)}
            return names | {"null_space_damping": np.asarray(5.0), "regularisation": np.asarray(1e-2)}
        return impedance_gains(law, rng)

    def numbers(self, seed: int = 0, actions: dict[str, Any] | None = None, **levels: float) -> np.ndarray:
        """Return p: random gains and fallback, a tank with `LEVELS` unless told, and the actions that are on."""
        robot, parts = self.controller.law.robot, self.controller.parameters
        shares = OFF | (actions or {})
        values = ControlParameters(
            model=robot.nominal(),
            gains=self.gains(seed),
            fallback=self.gains(seed + 1),
            tank={f"tank_{name}": value for name, value in (LEVELS | levels).items()},
            actions={f.name: np.broadcast_to(shares[f.name], f.shape) for f in action_layout(self.n)},
            observer={"bandwidth": 50.0},
            inner={f.name: 0.5 for f in parts["inner"]},
            errors={f.name: np.zeros(f.shape) for f in parts["errors"]} | {"torque_bandwidth": UNFILTERED},
        )
        return parts.pack(values._asdict())

    def fallen(self, p: np.ndarray) -> np.ndarray:
        """Return p with the fallback's gains as those of the law."""
        model, gains = (self.controller.parameters[part].size for part in ("model", "gains"))
        out = p.copy()
        out[model : model + gains] = p[model + gains : model + 2 * gains]
        return out

    def start(self, told: np.ndarray, level: float, **known: Any) -> np.ndarray:
        """Return the state before the first period, with the reference and stiffness of this row in force."""
        layout, t = self.controller.state, self.told.unpack(told)
        values = {f.name: np.zeros(f.shape) for f in layout} | {
            "governed_position": t["position"],
            "governed_rotation": t["rotation"],
            "held_stiffness": t["stiffness"],
            "tank_energy": level,
            "lowest_level": level,
        }
        return layout.pack(values | known)

    def random(self, rng: np.random.Generator, count: int = 1, **fixed: Any) -> np.ndarray:
        """Return rows of unphysical measurements: each has nothing to do with the one before."""
        n, k = self.n, self.controller.law.task.size
        rows = []
        for _ in range(count):
            q = rng.uniform(-2, 2, n)
            values = {
                "q": q, "theta": q + rng.normal(size=n) * 0.01, "dq": rng.normal(size=n), "dtheta": rng.normal(size=n),
                "tau_a": rng.normal(size=n) * 20, "F_e": rng.normal(size=6) * 10, "tau_e": rng.normal(size=n) * 5,
                "position": rng.normal(size=3), "rotation": rotation(rng), "velocity": rng.normal(size=6),
                "acceleration": rng.normal(size=6), "stiffness": definite(rng, k, 10, 1000),
                "damping": definite(rng, k, 1, 100), "wrench": rng.normal(size=6) * 10, "elapsed": PERIOD,
                "given": rng.normal(size=n),
            }  # fmt: skip
            rows.append(self.told.pack(values | fixed))
        return np.array(rows)

    def run(self, state: np.ndarray, told: np.ndarray, p: np.ndarray) -> SimpleNamespace:
        """Return the fields of state and ledger after each row, with the command, and the last state as `end`."""
        n = len(told)
        states, commands, ledger = self.period.mapaccum(n)(state, told.T, np.tile(p[:, None], n))
        states = np.array(states).T
        fields = self.controller.state.unpack(states)
        entry = {f"entry_{k}": v for k, v in LEDGER.unpack(np.array(ledger).T).items()}
        return SimpleNamespace(**fields, **entry, command=np.array(commands).T, states=states, end=states[-1])

    def law_says(self, told: np.ndarray, p: np.ndarray, added: np.ndarray | float = 0.0) -> SimpleNamespace:
        """Return τ_m, S and f(φ), φ̇ of the law alone, for one row."""
        out = self.alone(told, p, np.broadcast_to(added, self.n))
        tau_m, inner, potential, position, axes, dphi = (np.array(x) for x in out)
        return SimpleNamespace(
            command=tau_m.ravel(), storage=inner.item() + potential.item(), potential=potential.item(),
            position=position.ravel(), rotation=axes, dphi=dphi.ravel(),
        )  # fmt: skip

    def but(self, told: np.ndarray, **changes: Any) -> np.ndarray:
        """Return a row with other values."""
        return self.told.pack(self.told.unpack(told) | changes)


def _said(t: SimpleNamespace) -> tuple[Measurement, Setpoint]:
    pose = EndEffectorPose(t.position, t.rotation)
    setpoint = Setpoint(pose, t.velocity, t.acceleration, t.stiffness, t.damping, t.wrench)
    return Measurement(*(getattr(t, name) for name in Measurement._fields)), setpoint


@lru_cache
def planar() -> FlexibleJointRobot:
    return FlexibleJointRobot.load("planar2r")


@lru_cache
def planar_rig(*choices: Any, rigid: bool = False) -> Rig:
    """Return a rig of `planar2r` that holds positions, with the tank (the port's if not told) and so on."""
    law = (RigidImpedanceLaw if rigid else ImpedanceLaw)(planar(), PositionTask(), StaticGravity())
    return Rig(SampledController(law, *(choices or (PortTank(),)), compensates=True))


@lru_cache
def spatial_rig() -> Rig:
    """Return a rig of a random arm with three joints that holds poses."""
    robot = with_joints(_chain(3, 7, True), 7)
    return Rig(
        SampledController(ImpedanceLaw(robot, PoseTask(), StaticGravity()), PortTank(), compensates=True)
    )
