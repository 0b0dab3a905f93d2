"""What a sampled loop is schedule in one period: a pure function of the time, of what was ordered, and of chance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as cs

from passiflex.control.motion import MOTION, reference_at
from passiflex.control.tool_axes import in_world
from passiflex.layout import Field, Layout

SHORTEST = 1e-9
"""Two instants closer than this are one [s]: gains that go over meanwhile are there at once."""


@dataclass(frozen=True)
class PeriodRow:
    """The row of a loop with n joints, k directions of its task, and these environment.

    `schedule` holds what stays from one event to the next, `drawn` what is new in every period.
    """

    n: int
    k: int
    environment: Layout
    turned: bool = False
    """As `AbstractTask.turned`."""
    noisy: bool = False
    """Whether there is noise on q and θ."""

    @cached_property
    def layout(self) -> Layout:
        """Return the row; the environment come first."""
        return self.environment + self.told

    @cached_property
    def told(self) -> Layout:
        """Return what the law is told: the row without the environment."""
        n, k = self.n, self.k
        return Layout(
            (
                Field("desired_position", (3,), "m", "x_d", axes=("axis",)),
                Field("desired_rotation", (3, 3), "1", "axes of x_d", axes=("axis", "column")),
                Field("desired_velocity", (6,), "m/s, rad/s", "ẋ_d", kept=False),
                Field("desired_acceleration", (6,), "m/s^2, rad/s^2", "ẍ_d", kept=False),
                Field("desired_stiffness", (k, k), "N/m, N, N m/rad", "K_x", kept=False),
                Field("desired_damping", (k, k), "N s/m, N s, N m s/rad", "D_x", kept=False),
                Field("feedforward", (6,), "N, N m", "wrench that the end effector is to exert", kept=False),
                Field("torque_noise", (n,), "N m", "of the joint torque sensors", kept=False),
                *self._position_noise,
                Field("elapsed", (), "s", "since the last period that ran", kept=False),
            )
        )

    @property
    def _position_noise(self) -> tuple[Field, ...]:
        named = {"link_noise": "of the readings of q", "motor_noise": "of the readings of θ"}
        return tuple(
            Field(name, (self.n,), "rad", said, kept=False) for name, said in named.items() if self.noisy
        )

    @cached_property
    def schedule(self) -> Layout:
        """Return what is schedule at an event, and holds until the next."""
        k = self.k
        own = (
            Field("began", (), "s", "when the motion of the reference began"),
            Field("old_stiffness", (k, k), "N/m, N, N m/rad", "K_x before the change of gains"),
            Field("new_stiffness", (k, k), "N/m, N, N m/rad", "and after it"),
            Field("old_damping", (k, k), "N s/m, N s, N m s/rad", "D_x before the change of gains"),
            Field("new_damping", (k, k), "N s/m, N s, N m s/rad", "and after it"),
            Field("old_in_tool", (2,), "1", "1 for those that are in the axes of the reference: K_x, D_x"),
            Field("new_in_tool", (2,), "1", "and after it"),
            Field("change_from", (), "s", "when the change of gains begins"),
            Field("change_to", (), "s", "when it has ended"),
            Field("change_linear", (), "1", "1 if it goes linearly, 0 with minimum jerk"),
            Field("feedforward", (6,), "N, N m", "wrench that the end effector is to exert"),
        )
        return self.environment + MOTION + Layout(own)

    @cached_property
    def drawn(self) -> Layout:
        """Return what is new in every period."""
        names = {"torque_noise", "elapsed", *(f.name for f in self._position_noise)}
        return Layout(tuple(f for f in self.layout if f.name in names))

    @cached_property
    def function(self) -> cs.Function:
        """Return (time, schedule, drawn) → row. Gains go over to others with minimum jerk, linearly, or at once."""
        time = cs.SX.sym("time")
        schedule, c = self.schedule.symbols("schedule")
        drawn, chance = self.drawn.symbols("drawn")
        clock = cs.SX.sym("clock")
        motion = reference_at(clock, cs.SX(1), c)
        acceleration = cs.jacobian(motion.velocity, clock)
        known = cs.Function(
            "known", [clock, schedule], [*motion.pose, motion.velocity, acceleration], {"cse": True}
        )
        position, rotation, velocity, acceleration = known(cs.fmax(time - c.began, 0), schedule)
        lasts = c.change_to - c.change_from
        s = cs.fmin(cs.fmax((time - c.change_from) / cs.fmax(lasts, SHORTEST), 0), 1)
        s = cs.if_else(lasts > SHORTEST, s, 1)
        blend = cs.if_else(c.change_linear > 0, s, s**3 * (10 - 15 * s + 6 * s**2))

        def told(old: cs.SX, new: cs.SX, i: int) -> cs.SX:
            whole = i == 1 and not self.turned
            old = in_world(old, rotation, c.old_in_tool[i], whole=whole)
            return _between(old, in_world(new, rotation, c.new_in_tool[i], whole=whole), blend)

        values = {f.name: getattr(c, f.name) for f in self.environment} | {
            "desired_position": position,
            "desired_rotation": rotation,
            "desired_velocity": velocity,
            "desired_acceleration": acceleration,
            "desired_stiffness": told(c.old_stiffness, c.new_stiffness, 0),
            "desired_damping": told(c.old_damping, c.new_damping, 1),
            "feedforward": c.feedforward,
            **vars(chance),
        }
        row = self.layout.stack(values)
        return cs.Function("row", [time, schedule, drawn], [cs.densify(row)], {"cse": True})


def _between(old: cs.SX, new: cs.SX, blend: cs.SX) -> cs.SX:
    """Return what is between old and new, exactly the new in the end."""
    return cs.if_else(blend >= 1, new, old + blend * (new - old))
