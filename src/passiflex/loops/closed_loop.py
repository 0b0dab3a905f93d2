"""The closed loop of plant (2), law and tank (19) as one vector field with its energies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs

from passiflex.control.law import AbstractLaw
from passiflex.control.motion import MOTION, reference_at
from passiflex.control.signals import Command, Measurement
from passiflex.control.tank import EnergyTank
from passiflex.layout import Field, Layout
from passiflex.loops.plant import PORTS, Plant
from passiflex.loops.witness import Instant, Witness
from passiflex.robots.flexible import RobotState

ENERGIES = Layout(
    (
        *PORTS,
        Field("joint_damping", (), "J", "claimed by the law: lost in D_e"),
        Field("cartesian_damping", (), "J", "claimed by the law: lost in D_x"),
        Field("null_space_damping", (), "J", "claimed by the law: lost in D_ns"),
        Field("reference", (), "J", "∫ P_X: given by the moving reference"),
        Field("drawn", (), "J", "taken from the tank"),
        Field("spilled", (), "J", "part of P_D that the tank did not take"),
    )
)


class _Signals(NamedTuple):
    """Everything that one evaluation of the closed loop knows."""

    derivative: cs.SX
    powers: cs.SX
    outputs: cs.SX


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Plant, law and tank in continuous time, with separate parameters of plant and law's model.

    The state is (q, θ, q̇, θ̇, T, s), with s the reference's clock; the input holds the coefficients of
    the reference's motion, the wrench F_e and the noise on τ_a, all constant between two events; the
    parameters are those of the plant, of the law's model, of the law, of the tank. `rhs`, `outputs`, `watch`
    and `law_function` are CasADi functions of flat vectors, ready for code generation.
    """

    law: AbstractLaw
    tank: EnergyTank = EnergyTank()

    @cached_property
    def plant(self) -> Plant:
        """Return the plant, which nothing but a wrench touches."""
        return Plant(self.law.robot, ())

    @cached_property
    def state(self) -> Layout:
        """Return the state."""
        own = (
            Field("tank_energy", (), "J", "T"),
            Field("clock", (), "s", "s, the reference's own time since its last event"),
        )
        return self.plant.state + Layout(own)

    @cached_property
    def inputs(self) -> Layout:
        """Return what is constant between two events."""
        n, (_, _, torque) = self.law.robot.n, self.law.robot.arm.chain.joint_units
        return MOTION + Layout(
            (
                Field("F_e", (6,), "N, N m", "wrench on the end effector, world axes"),
                Field("torque_noise", (n,), torque, "added to the measured τ_a"),
            )
        )

    @cached_property
    def parameters(self) -> tuple[Layout, Layout, Layout, Layout]:
        """Return the layouts of plant, law's model, gains and tank, in this order."""
        return self.plant.parameters, self.law.robot.layout, self.law.layout, self.tank.layout

    @cached_property
    def output_layout(self) -> Layout:
        """Return the recorded signals."""
        n, (angle, speed, torque) = self.law.robot.n, self.law.robot.arm.chain.joint_units
        claimed = "claimed by the law"
        return Layout(
            (
                Field("position", (3,), "m", "end effector", axes=("axis",)),
                Field("rotation", (3, 3), "1", "axes of the end effector", axes=("axis", "column")),
                Field("desired_position", (3,), "m", "reference x_d", axes=("axis",)),
                Field("desired_rotation", (3, 3), "1", "axes of the reference", axes=("axis", "column")),
                Field("phi", (n,), angle, "shaped motor coordinate of (11)"),
                Field("dphi", (n,), speed, "its velocity"),
                Field("tau_m", (n,), torque, "motor torque"),
                Field("tau_a", (n,), torque, "torque through the joint, positive on the link"),
                Field("tau_e", (n,), torque, "external joint torque"),
                Field("tau_u", (n,), torque, "outer-loop torque"),
                Field("wrench", (6,), "N, N m", "F_e on the end effector", axes=("component",)),
                Field("link_kinetic_energy", (), "J", "½ q̇ᵀ M q̇"),
                Field("motor_kinetic_energy", (), "J", "½ θ̇ᵀ B θ̇"),
                Field("joint_spring_energy", (), "J", "½ (θ−q)ᵀ K (θ−q)"),
                Field("potential_energy", (), "J", "V(q)"),
                Field("compensated_energy", (), "J", f"V̂(q) of the law's model, {claimed}"),
                Field("shaped_kinetic_energy", (), "J", f"½ φ̇ᵀ B_e φ̇, {claimed}"),
                Field("shaped_spring_energy", (), "J", f"½ (φ−q)ᵀ K_e (φ−q), {claimed}"),
                Field("cartesian_spring_energy", (), "J", f"U(φ; x_d), {claimed}"),
                Field("gravity_storage", (), "J", f"of the gravity compensation, {claimed}"),
                Field("fill", (), "1", "α"),
                Field("valve", (), "1", "β"),
            )
        ) + Layout(tuple(Field(f"{f.name}_power", (), "W", f"rate of {f.name}_energy") for f in ENERGIES))

    @cached_property
    def _vectors(self) -> tuple[cs.SX, cs.SX, cs.SX]:
        size = sum(part.size for part in self.parameters)
        return cs.SX.sym("x", self.state.size), cs.SX.sym("u", self.inputs.size), cs.SX.sym("p", size)

    def _views(self) -> tuple[SimpleNamespace, ...]:
        x, u, p = self._vectors
        views, start = [self.state.view(x), self.inputs.view(u)], 0
        for part in self.parameters:
            views.append(part.view(p[start : start + part.size]))
            start += part.size
        return tuple(views)

    @cached_property
    def _signals(self) -> _Signals:
        x, u, plant, model, gains, tank = self._views()
        arm = self.law.robot.arm
        state = RobotState(x.q, x.theta, x.dq, x.dtheta)
        valve = self.tank.valve(x.tank_energy, tank) if self.law.has_tank else cs.SX(1)
        reference = reference_at(x.clock, valve, u)

        true = self.plant.true(state, u, plant)
        noisy = true["tau_a"] + u.torque_noise
        measurement = Measurement(x.q, x.theta, x.dq, x.dtheta, noisy, u.F_e, true["tau_e"])
        command: Command = self.law.command(measurement, reference, model, gains)
        claim = command.energy
        tank_flow = self.tank.flow(x.tank_energy, claim.dissipated_power, claim.reference_power, tank)
        flow = self.plant.flow(state, command.tau_m, u, plant)

        powers = ENERGIES.stack(
            {
                **flow.powers,
                "joint_damping": claim.joint_damping,
                "cartesian_damping": claim.cartesian_damping,
                "null_space_damping": claim.null_space_damping,
                "reference": claim.reference_power,
                "drawn": tank_flow.drawn if self.law.has_tank else 0,
                "spilled": tank_flow.spilled if self.law.has_tank else claim.dissipated_power,
            }
        )
        derivative = self.state.stack(
            {
                "q": x.dq,
                "theta": x.dtheta,
                "dq": flow.ddq,
                "dtheta": flow.ddtheta,
                "tank_energy": tank_flow.rate if self.law.has_tank else 0,
                "clock": valve,
            }
        )
        outputs = cs.vertcat(
            Layout(self.output_layout.fields[: -len(ENERGIES.fields)]).stack(
                {
                    **true,
                    "desired_position": reference.pose.position,
                    "desired_rotation": reference.pose.rotation,
                    "phi": command.phi,
                    "dphi": command.dphi,
                    "tau_m": command.tau_m,
                    "tau_u": command.tau_u,
                    "compensated_energy": arm.potential_energy(x.q, model),
                    "shaped_kinetic_energy": claim.motor_kinetic,
                    "shaped_spring_energy": claim.joint_spring,
                    "cartesian_spring_energy": claim.cartesian_spring,
                    "gravity_storage": claim.gravity_storage,
                    "fill": tank_flow.fill,
                    "valve": valve,
                }
            ),
            powers,
        )
        return _Signals(derivative, powers, outputs)

    @cached_property
    def rhs(self) -> cs.Function:
        """Return (x, u, p) → (ẋ, powers): the vector field and the integrands of `ENERGIES`."""
        s = self._signals
        return cs.Function(
            "rhs", list(self._vectors), [cs.densify(s.derivative), cs.densify(s.powers)], {"cse": True}
        )

    @cached_property
    def outputs(self) -> cs.Function:
        """Return (x, u, p) → the signals of `output_layout`."""
        return cs.Function("outputs", list(self._vectors), [cs.densify(self._signals.outputs)], {"cse": True})

    @cached_property
    def witness(self) -> Witness:
        """Return what notes the extremes."""
        return Witness.of(self.law.robot, has_tank=self.law.has_tank, sampled=False)

    @cached_property
    def watch(self) -> cs.Function:
        """Return (memory, time, (x, energies), u, p) → memory, with p as for `rhs`, then that of the witness."""
        (x, u, p), law, witness = self._vectors, self.law, self.witness
        memory, w = witness.memory.symbols("w")
        time, p_watch = cs.SX.sym("time"), cs.SX.sym("p_watch", witness.parameters.size)
        energies, passed = ENERGIES.symbols("energies")
        s, inputs, plant, model, gains, tank = self._views()
        arm, zero = law.robot.arm, cs.SX.zeros(law.robot.n)
        stored = law.stored(
            Measurement(s.q, s.theta, s.dq, s.dtheta, zero, cs.SX.zeros(6), zero), model, gains
        )
        valve = self.tank.valve(s.tank_energy, tank) if law.has_tank else cs.SX(1)
        reference = reference_at(s.clock, valve, inputs).pose
        storage = stored.energy + law.task.potential(stored.pose, reference, gains.stiffness)
        kinetic, potential = arm.kinetic_energy(s.q, s.dq, plant), arm.potential_energy(s.q, plant)
        carried = arm.potential_energy(s.q, model)
        held = kinetic + potential + storage + (s.tank_energy if law.has_tank else 0)
        now = Instant(
            time=time,
            q=s.q,
            dq=s.dq,
            tau_m=None,
            link_kinetic=kinetic,
            link_potential=potential,
            carried=carried,
            external=passed.external,
            joint=passed.joint,
            reference=passed.reference,
            storage=storage + carried,
            books=held - passed.external - passed.reference + passed.drawn + passed.spilled,
        )
        after = witness.look(w, now, witness.parameters.view(p_watch))
        arguments = [memory, time, cs.vertcat(x, energies), u, cs.vertcat(p, p_watch)]
        return cs.Function("watch", arguments, [cs.densify(after)], {"cse": True})

    @cached_property
    def law_function(self) -> cs.Function:
        """Return the control law alone: (q, θ, q̇, θ̇, τ_a, F_e, clock and motion, model, gains) → τ_m."""
        n = self.law.robot.n
        q, theta, dq, dtheta, tau_a = (cs.SX.sym(s, n) for s in ("q", "theta", "dq", "dtheta", "tau_a"))
        F_e = cs.SX.sym("F_e", 6)
        clock = cs.SX.sym("clock")
        motion, c = MOTION.symbols("motion")
        model, m = self.law.robot.layout.symbols("model")
        gains, g = self.law.layout.symbols("gains")
        tau_e = self.law.robot.arm.jacobian(q, m).T @ F_e
        y = Measurement(q, theta, dq, dtheta, tau_a, F_e, tau_e)
        command = self.law.command(y, reference_at(clock, cs.SX(1), c), m, g)
        arguments = [q, theta, dq, dtheta, tau_a, F_e, clock, motion, model, gains]
        return cs.Function("law", arguments, [cs.densify(command.tau_m)], {"cse": True})
