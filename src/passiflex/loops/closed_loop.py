"""The closed loop of plant (2), law and tank (19) as one vector field with its energies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import casadi as cs

from passiflex.control.law import AbstractLaw
from passiflex.control.motion import MOTION, reference_at
from passiflex.control.signals import Command, Measurement, Reference
from passiflex.control.tank import EnergyTank
from passiflex.layout import Field, Layout, Signal
from passiflex.loops.claims import claimed_energies, outer_torque, shaped_motion
from passiflex.loops.plant import Elements, Plant, Truth
from passiflex.loops.witness import Instant, Witness
from passiflex.parts import Parts

OF_THE_LAW = Layout(
    (
        Field("joint_damping", (), "J", "claimed by the law: lost in D_e"),
        Field("cartesian_damping", (), "J", "claimed by the law: lost in D_x"),
        Field("null_space_damping", (), "J", "claimed by the law: lost in D_ns"),
        Field("reference", (), "J", "∫ P_X: given by the moving reference"),
        Field("drawn", (), "J", "taken from the tank"),
        Field("spilled", (), "J", "part of P_D that the tank did not take"),
    )
)
"""What passes within a law in continuous time, by its own claims."""


class _Signals(NamedTuple):
    """Everything that one evaluation of the closed loop knows."""

    derivative: cs.SX
    powers: cs.SX
    outputs: tuple[Signal, ...]


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Plant, law and tank in continuous time, with separate parameters of plant and law's model.

    The state is (q, θ, q̇, θ̇, T, s), with s the reference's clock; the input holds the coefficients of
    the reference's motion, the wrench F_e and the noise on τ_a, all constant between two events; the
    parameters are those of the plant, of the law's model, of the law, of the tank. `rhs`, `outputs`, `watch`
    and `law_function` are CasADi functions of flat vectors, ready for code generation.
    """

    law: AbstractLaw
    elements: Elements = ()
    tank: EnergyTank = EnergyTank()

    @cached_property
    def plant(self) -> Plant:
        """Return the plant."""
        return Plant(self.law.robot, self.elements)

    @cached_property
    def energies(self) -> Layout:
        """Return what is summed up over time."""
        return self.plant.energies + OF_THE_LAW

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
        noise = Field("torque_noise", (n,), torque, "added to the measured τ_a")
        return MOTION + self.plant.environment + Layout((noise,))

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of plant, law's model, gains and tank."""
        model, gains = self.law.robot.layout, self.law.layout
        return Parts(
            {"plant": self.plant.parameters, "model": model, "gains": gains, "tank": self.tank.layout}
        )

    @cached_property
    def output_layout(self) -> Layout:
        """Return the recorded signals."""
        return Layout.of(self._signals.outputs)

    @cached_property
    def _vectors(self) -> tuple[cs.SX, cs.SX, cs.SX]:
        sizes = {"x": self.state.size, "u": self.inputs.size, "p": self.parameters.size}
        x, u, p = (cs.SX.sym(name, size) for name, size in sizes.items())
        return x, u, p

    def _views(self) -> tuple[Any, ...]:
        x, u, p = self._vectors
        return self.state.view(x), self.inputs.view(u), *self.parameters.view(p).values()

    @cached_property
    def _signals(self) -> _Signals:
        x, u, plant, model, gains, tank = self._views()
        arm = self.law.robot.arm
        state = self._vectors[0][: self.plant.state.size]
        valve = self.tank.valve(x.tank_energy, tank) if self.law.has_tank else cs.SX(1)
        reference = reference_at(x.clock, valve, u)

        true = self.plant.true(state, u, plant)
        measurement = Measurement(
            *self.plant.view(state), true.tau_a.value + u.torque_noise, true.wrench.value, true.tau_e.value
        )
        command: Command = self.law.command(measurement, reference, model, gains)
        claim, has_tank = command.energy, self.law.has_tank
        tank_flow = self.tank.flow(x.tank_energy, claim.dissipated_power, claim.reference_power, tank)
        flow = self.plant.flow(state, command.tau_m, u, plant)
        powers = self.energies.stack(
            {
                **flow.powers,
                "joint_damping": claim.joint_damping,
                "cartesian_damping": claim.cartesian_damping,
                "null_space_damping": claim.null_space_damping,
                "reference": claim.reference_power,
                "drawn": tank_flow.drawn if has_tank else 0,
                "spilled": tank_flow.spilled if has_tank else claim.dissipated_power,
            }
        )
        own = {"tank_energy": tank_flow.rate if has_tank else 0, "clock": valve}
        derivative = self.state.stack(flow.rate | own)
        carried = arm.potential_energy(x.q, model)
        rates = (
            Signal(Field(f"{f.name}_power", (), "W", f"rate of {f.name}_energy"), power)
            for f, power in zip(self.energies, cs.vertsplit(powers), strict=True)
        )
        outputs = (*self._said(true, reference, command, carried), *_of_tank(tank_flow.fill, valve), *rates)
        return _Signals(derivative, powers, outputs)

    def _said(
        self, true: Truth, reference: Reference, command: Command, carried: cs.SX
    ) -> tuple[Signal, ...]:
        """Return what is true, what the reference does, and what the law asks for and claims."""
        robot, (position, rotation) = self.law.robot, reference.pose
        torque, across = robot.arm.chain.joint_units[2], ("axis", "column")
        return (
            true.position,
            true.rotation,
            Signal(Field("desired_position", (3,), "m", "reference x_d", axes=("axis",)), position),
            Signal(Field("desired_rotation", (3, 3), "1", "axes of the reference", axes=across), rotation),
            *shaped_motion(robot, command),
            Signal(Field("tau_m", (robot.n,), torque, "motor torque"), command.tau_m),
            true.tau_a,
            true.tau_e,
            outer_torque(robot, command),
            true.wrench,
            *true.energies,
            *true.touched,
            *claimed_energies(command, carried, "x_d"),
        )

    @cached_property
    def rhs(self) -> cs.Function:
        """Return (x, u, p) → (ẋ, powers): the vector field and the integrands of `energies`."""
        s = self._signals
        return cs.Function(
            "rhs", list(self._vectors), [cs.densify(s.derivative), cs.densify(s.powers)], {"cse": True}
        )

    @cached_property
    def outputs(self) -> cs.Function:
        """Return (x, u, p) → the signals of `output_layout`."""
        return cs.Function(
            "outputs",
            list(self._vectors),
            [cs.densify(self.output_layout.stack_of(self._signals.outputs))],
            {"cse": True},
        )

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
        energies, passed = self.energies.symbols("energies")
        s, inputs, plant, model, gains, tank = self._views()
        arm, zero = law.robot.arm, cs.SX.zeros(law.robot.n)
        stored = law.stored(
            Measurement(s.q, s.theta, s.dq, s.dtheta, zero, cs.SX.zeros(6), zero), model, gains
        )
        valve = self.tank.valve(s.tank_energy, tank) if law.has_tank else cs.SX(1)
        reference = reference_at(s.clock, valve, inputs).pose
        storage = stored.energy + law.potential(stored, reference, gains.stiffness)
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


def _of_tank(fill: cs.SX, valve: cs.SX) -> tuple[Signal, ...]:
    return Signal(Field("fill", (), "1", "α"), fill), Signal(Field("valve", (), "1", "β"), valve)
