"""What a loop notes at every step, so that a verdict is an extremum over time and not over rows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.layout import Field, Layout
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]

ROUND_OFF = 1e-13
"""An overdraft below this share of the energy at hand (or of 1 J) is round-off."""
TERMS = (
    "nothing",
    "motion of the links",
    "moving reference",
    "work on the environment",
    "model error and noise",
)
"""What may have taken most of the energy; the last is what the law's books miss, whatever it comes from."""
LARGEST = 1e300
"""An energy [J] beyond it is that of a run that leaves the finite numbers, and decides nothing."""
SLACK = 1e-9
"""Share of a limit by which rounding may pass it."""


class Instant(NamedTuple):
    """What a loop knows at one instant; energies in J, those that passed a port since the start.

    Attributes
    ----------
    time: [s].
    q, dq: Of the links, (n,).
    tau_m: Motor torque in force (n,); None where nobody knows it at every step.
    link_kinetic, link_potential: ½ q̇ᵀ M q̇ and V(q).
    carried: V̂(q), the weight that the law's model knows of.
    external, joint: ∫ τ_eᵀ q̇ and ∫ τ_aᵀ q̇.
    reference: Given by the moving reference.
    storage: S̃, with the weight carried.
    books: Stored, less supplied, plus lost, by the law's own books: constant if they are right.
    beyond: What the law claims to have, and what it gave: constant or falling unless it claims more than is there;
        −∞ where it claims nothing. None if its books are no more than `books`.
    """

    time: cs.SX
    q: cs.SX
    dq: cs.SX
    tau_m: cs.SX | None
    link_kinetic: cs.SX
    link_potential: cs.SX
    carried: cs.SX
    external: cs.SX
    joint: cs.SX
    reference: cs.SX
    storage: cs.SX
    books: cs.SX
    beyond: cs.SX | None = None


class Noted(NamedTuple):
    """What was noted of a whole run: what each number is, and the numbers by name."""

    layout: Layout
    values: dict[str, Array]


@dataclass(frozen=True)
class Witness:
    """A memory of one vector, and how it goes on with every instant; zeros before the first.

    It keeps the least margin S̃₀ + T₀ (+ what a law without a tank was lent by its reference) − W̃, with
    W̃ = ∫ τ_aᵀ q̇ − (V̂(q) − V̂(q₀)), when it was and what had taken most by then; the first overdraft; and
    how far each joint went. The start is the instant before the reference moves for the first time.

    Parameters
    ----------
    n: Joints.
    angle, speed, torque: Units of their quantities.
    has_tank: Whether the law has a tank.
    motors: Whether the motors' torque is known at every step.
    """

    n: int
    angle: str
    speed: str
    torque: str
    has_tank: bool
    motors: bool

    @classmethod
    def of(cls, robot: FlexibleJointRobot, *, has_tank: bool, motors: bool) -> Witness:
        """Return the witness for loops of a robot."""
        return cls(robot.n, *robot.arm.chain.joint_units, has_tank, motors)

    @cached_property
    def parameters(self) -> Layout:
        """Return the numbers that it is told."""
        n = self.n
        return Layout(
            (
                Field("initial_tank", (), "J", "T₀; 0 for a law without a tank"),
                Field("lower_position_limit", (n,), self.angle, "of the robot"),
                Field("upper_position_limit", (n,), self.angle, "of the robot"),
                Field("velocity_limit", (n,), self.speed, "of the robot"),
                Field("torque_limit", (n,), self.torque, "of the robot"),
            )
        )

    @cached_property
    def start(self) -> Layout:
        """Return what it remembers of the start, for itself."""
        kept = (
            "noted",
            "link_start",
            "carried_start",
            "storage_start",
            "books_start",
            "beyond_start",
            "largest",
        )
        return Layout(tuple(Field(name, (), "J") for name in kept))

    @cached_property
    def extremes(self) -> Layout:
        """Return what it remembers for those who read the run."""
        n, never = self.n, "infinite if never"
        energies = (
            Field("least_margin", (), "J", "least of S̃₀ + T₀ − W̃ over all time"),
            Field("least_margin_time", (), "s", "when it was"),
            Field("least_margin_term", (), "1", f"what had taken most by then: number in {', '.join(TERMS)}"),
            Field("least_margin_sure", (), "J", "least of the margin less the integration error"),
            Field("least_margin_possible", (), "J", "least of the margin plus the integration error"),
            Field("overdraft_time", (), "s", f"first time when more was given than was there, {never}"),
            Field("overdraft_term", (), "1", "what had taken most by then"),
            Field("lowest_storage", (), "J", "least S̃"),
            Field("largest_integration_error", (), "J", "largest residual of the links' balance"),
            Field("largest_books_error", (), "J", "by how much the law's books were wrong at most"),
        )
        joints = [
            Field("lowest_q", (n,), self.angle, "least link position"),
            Field("highest_q", (n,), self.angle, "largest link position"),
            Field("highest_speed", (n,), self.speed, "largest |q̇|"),
        ]
        joints += [Field("highest_torque", (n,), self.torque, "largest |τ_m|")] if self.motors else []
        for kind in self.kinds:
            joints.append(
                Field(f"{kind}_time", (), "s", f"first time beyond a joint's {kind} limit, {never}")
            )
            joints.append(Field(f"{kind}_joint", (), "1", "which joint that was, from 1"))
        return Layout((*energies, *joints))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Return the kinds of limits that are watched."""
        return ("position", "speed", *["torque"] * self.motors)

    @property
    def memory(self) -> Layout:
        """Return all that is remembered."""
        return self.start + self.extremes

    def numbers(self, robot: FlexibleJointRobot, initial: float) -> Array:
        """Return the parameters; limits may be infinite."""
        low, high = robot.position_limit.T
        return np.concatenate(
            [[initial * self.has_tank], low, high, robot.velocity_limit, robot.torque_limit]
        ).astype(float)

    def noted(self, memory: Array) -> Noted:
        """Return what is of interest of a memory. A storage counts from its lowest value, if that is negative."""
        values = self.extremes.unpack(memory[self.start.size :].copy())
        for name in ("least_margin", "least_margin_sure", "least_margin_possible"):
            values[name] -= np.minimum(values["lowest_storage"], 0.0)
        return Noted(self.extremes, values)

    def after(self, w: SimpleNamespace, now: Instant, g: SimpleNamespace) -> cs.SX:
        """Return the memory after an instant."""
        first = w.noted < 1
        link = now.link_kinetic + now.link_potential
        begun = {
            "link_start": link,
            "carried_start": now.carried,
            "storage_start": now.storage - now.reference,
            "books_start": now.books,
            "beyond_start": cs.SX(0) if now.beyond is None else now.beyond,
        }
        start = SimpleNamespace(**{k: cs.if_else(first, v, getattr(w, k)) for k, v in begun.items()})
        error = cs.fmax(
            w.largest_integration_error, cs.fabs(link - start.link_start - now.external - now.joint)
        )
        largest = cs.fmax(w.largest, cs.fabs(link))
        values = vars(start) | {"noted": 1, "largest": largest}
        values |= self._margin(w, now, start, g, first, error, ROUND_OFF * cs.fmax(1, largest))
        values["largest_integration_error"] = error
        missed = now.books - start.books_start
        wrong = cs.fabs(missed) if now.beyond is None else now.beyond - start.beyond_start
        values["largest_books_error"] = cs.fmax(w.largest_books_error, wrong)
        values |= self._joints(w, now, g, first)
        return self.memory.stack(values)

    def _margin(
        self,
        w: SimpleNamespace,
        now: Instant,
        start: SimpleNamespace,
        g: SimpleNamespace,
        first: cs.SX,
        error: cs.SX,
        round_off: cs.SX,
    ) -> dict[str, cs.SX]:
        whole = g.initial_tank + start.storage_start
        given = now.joint - (now.carried - start.carried_start)
        margin = whole - given + (0 if self.has_tank else now.reference)
        usable = cs.fabs(margin) < LARGEST
        term = self._term(now, now.books - start.books_start)
        least = cs.if_else(first, whole, w.least_margin)
        lower = cs.logic_and(usable, margin < least)
        stored = cs.if_else(first, start.storage_start, w.lowest_storage)
        lowest = cs.if_else(now.storage < stored, now.storage, stored)
        sure, possible = (
            _least(usable, margin + e, cs.if_else(first, whole + round_off, kept))
            for e, kept in (
                (round_off - error, w.least_margin_sure),
                (round_off + error, w.least_margin_possible),
            )
        )
        before = cs.if_else(first, np.inf, w.overdraft_time)
        overdrawn = cs.logic_and(usable, margin + error + round_off - cs.fmin(lowest, 0) < 0)
        overdrawn = cs.logic_and(overdrawn, before == np.inf)
        return {
            "least_margin": cs.if_else(lower, margin, least),
            "least_margin_time": cs.if_else(cs.logic_or(first, lower), now.time, w.least_margin_time),
            "least_margin_term": cs.if_else(lower, term, w.least_margin_term),
            "least_margin_sure": sure,
            "least_margin_possible": possible,
            "overdraft_time": cs.if_else(overdrawn, now.time, before),
            "overdraft_term": cs.if_else(overdrawn, term, w.overdraft_term),
            "lowest_storage": lowest,
        }

    def _term(self, now: Instant, missed: cs.SX) -> cs.SX:
        """Return the number in `TERMS` of what took most; a law without a tank was lent what its reference gave."""
        draws = {
            1: now.link_kinetic,
            2: now.reference if self.has_tank else cs.SX(0),
            3: -now.external,
            4: missed,
        }
        most, term = cs.SX(ROUND_OFF), cs.SX(0)
        for number, draw in draws.items():
            term, most = cs.if_else(draw > most, number, term), cs.fmax(draw, most)
        return term

    def _joints(self, w: SimpleNamespace, now: Instant, g: SimpleNamespace, first: cs.SX) -> dict[str, cs.SX]:
        speed = cs.fabs(now.dq)
        values = {
            "lowest_q": cs.fmin(cs.if_else(first, now.q, w.lowest_q), now.q),
            "highest_q": cs.fmax(cs.if_else(first, now.q, w.highest_q), now.q),
            "highest_speed": cs.fmax(w.highest_speed, speed),
        }
        beyond = {
            "position": cs.fmax(g.lower_position_limit - now.q, now.q - g.upper_position_limit),
            "speed": speed - (1 + SLACK) * g.velocity_limit,
        }
        if now.tau_m is not None:
            torque = cs.fabs(now.tau_m)
            values["highest_torque"] = cs.fmax(w.highest_torque, torque)
            beyond["torque"] = torque - (1 + SLACK) * g.torque_limit
        for kind, excess in beyond.items():
            before = cs.if_else(first, np.inf, getattr(w, f"{kind}_time"))
            joint = cs.SX(0)
            for i in reversed(range(self.n)):
                joint = cs.if_else(excess[i] > 0, i + 1, joint)
            begins = cs.logic_and(joint > 0, before == np.inf)
            values[f"{kind}_time"] = cs.if_else(begins, now.time, before)
            values[f"{kind}_joint"] = cs.if_else(begins, joint, getattr(w, f"{kind}_joint"))
        return values


def _least(usable: cs.SX, value: cs.SX, kept: cs.SX) -> cs.SX:
    return cs.if_else(cs.logic_and(usable, value < kept), value, kept)
