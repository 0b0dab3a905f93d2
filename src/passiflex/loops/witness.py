"""What a loop notes at every step, so that a verdict is an extremum over time and not over rows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple, Protocol

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.layout import Field, Layout
from passiflex.loops.joint_extremes import JointExtremes, LimitNumbers
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
        None if `books` are all that it keeps.
    latched: Whether it has fallen back; None for a law that does not.
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
    latched: cs.SX | None = None


class WitnessNumbers(LimitNumbers, Protocol):
    """What a witness is told, in symbols, as `Witness.parameters` says."""

    initial_tank: cs.SX


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
    joints: What it notes of the joints.
    has_tank: Whether the law has a tank.
    sampled: Whether the law runs once per period, and may fall back.
    """

    joints: JointExtremes
    has_tank: bool
    sampled: bool

    @classmethod
    def of(cls, robot: FlexibleJointRobot, *, has_tank: bool, sampled: bool) -> Witness:
        """Return the witness for loops of a robot."""
        units = robot.arm.chain.joint_units
        return cls(JointExtremes(robot.n, *units, motors=sampled), has_tank, sampled)

    @cached_property
    def parameters(self) -> Layout:
        """Return the numbers that it is told."""
        initial = Field("initial_tank", (), "J", "T₀; 0 for a law without a tank")
        return Layout((initial, *self.joints.limits), WitnessNumbers)

    @cached_property
    def own(self) -> Layout:
        """Return what it remembers for itself: the start, the last look, and S̃₀ + T₀ with what was lent since."""
        kept = (
            "link_start",
            "carried_start",
            "storage_start",
            "books_start",
            "beyond_start",
            "largest",
            "whole",
        )
        whether, when = Field("noted", (), "1"), Field("looked", (), "s")
        return Layout((whether, when, *(Field(name, (), "J") for name in kept)))

    @cached_property
    def extremes(self) -> Layout:
        """Return what it remembers for those who read the run."""
        never = "infinite if never"
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
        fallback = Field("fallback_time", (), "s", f"when the law fell back, {never}")
        return Layout((*energies, *[fallback] * self.sampled)) + self.joints.layout

    @property
    def memory(self) -> Layout:
        """Return all that is remembered."""
        return self.own + self.extremes

    def numbers(self, robot: FlexibleJointRobot, initial: float) -> Array:
        """Return the parameters; limits may be infinite."""
        return np.concatenate([[initial * self.has_tank], self.joints.numbers(robot)])

    def noted(self, memory: Array) -> Noted:
        """Return what is of interest of a memory. A storage counts from its lowest value, if that is negative."""
        values = self.extremes.unpack(memory[self.own.size :].copy())
        for name in ("least_margin", "least_margin_sure", "least_margin_possible"):
            values[name] -= np.minimum(values["lowest_storage"], 0.0)
        return Noted(self.extremes, values)

    def glance(self, w: Any, time: cs.SX, joint: cs.SX, carried: cs.SX) -> cs.SX:
        """Return the memory after an instant between two looks, at which only W̃ has changed.

        What had taken most by then is seen at the next look.
        """
        return self.memory.stack(vars(w) | self._margin(w, w.whole, time, joint - carried + w.carried_start))

    def look(self, w: Any, now: Instant, g: WitnessNumbers) -> cs.SX:
        """Return the memory after an instant."""
        first = w.noted < 1
        start, was = self._start(w, now, g, first)
        residual = now.link_kinetic + now.link_potential - start.link_start - now.external - now.joint
        was.largest_integration_error = cs.fmax(w.largest_integration_error, cs.fabs(residual))
        missed = now.books - start.books_start
        wrong = cs.fabs(missed) if now.beyond is None else now.beyond - start.beyond_start
        found = self._margin(was, start.whole, now.time, now.joint - now.carried + start.carried_start)
        lower = cs.logic_or(found["least_margin"] < was.least_margin, w.looked < found["least_margin_time"])
        over = cs.logic_and(w.looked < found["overdraft_time"], found["overdraft_time"] <= now.time)
        term = self._term(now, missed)
        terms = {
            "least_margin_term": cs.if_else(cs.logic_and(lower, w.noted), term, w.least_margin_term),
            "overdraft_term": cs.if_else(over, term, w.overdraft_term),
        }
        known = {
            "noted": 1,
            "looked": cs.fmax(w.looked, now.time),
            "largest_books_error": cs.fmax(w.largest_books_error, wrong),
        }
        if now.latched is not None:
            fallback = cs.if_else(first, np.inf, w.fallback_time)
            known["fallback_time"] = cs.if_else(now.latched > 0, cs.fmin(fallback, now.time), fallback)
        joints = self.joints.after(w, now.time, now.q, now.dq, now.tau_m, g, first)
        return self.memory.stack(vars(start) | vars(was) | found | terms | known | joints)

    def _start(
        self, w: Any, now: Instant, g: WitnessNumbers, first: cs.SX
    ) -> tuple[SimpleNamespace, SimpleNamespace]:
        """Return what is remembered of the start, and of the extremes before this instant; all begins with it."""

        def kept(name: str, begins: cs.SX | float) -> cs.SX:
            return cs.if_else(first, begins, getattr(w, name))

        link = now.link_kinetic + now.link_potential
        start = SimpleNamespace(
            link_start=kept("link_start", link),
            carried_start=kept("carried_start", now.carried),
            storage_start=kept("storage_start", now.storage - now.reference),
            books_start=kept("books_start", now.books),
            beyond_start=kept("beyond_start", 0 if now.beyond is None else now.beyond),
        )
        whole = g.initial_tank + start.storage_start
        start.whole = whole if self.has_tank else whole + now.reference
        was = SimpleNamespace(
            largest=cs.fmax(w.largest, cs.fabs(link)),
            lowest_storage=_lower(now.storage, kept("lowest_storage", start.storage_start)),
            least_margin=kept("least_margin", whole),
            least_margin_time=kept("least_margin_time", now.time),
            least_margin_sure=kept("least_margin_sure", whole + ROUND_OFF),
            least_margin_possible=kept("least_margin_possible", whole + ROUND_OFF),
            overdraft_time=kept("overdraft_time", np.inf),
        )
        return start, was

    def _margin(self, w: Any, whole: cs.SX, time: cs.SX, given: cs.SX) -> dict[str, cs.SX]:
        """Return what the margin `whole` − `given` changes of what is remembered."""
        margin, error = whole - given, w.largest_integration_error
        round_off = ROUND_OFF * cs.fmax(1, w.largest)
        usable = cs.fabs(margin) < LARGEST
        lower = cs.logic_and(usable, margin < w.least_margin)
        possible = margin + error + round_off
        overdrawn = cs.logic_and(usable, possible < cs.fmin(w.lowest_storage, 0))
        overdrawn = cs.logic_and(overdrawn, w.overdraft_time == np.inf)
        return {
            "least_margin": cs.if_else(lower, margin, w.least_margin),
            "least_margin_time": cs.if_else(lower, time, w.least_margin_time),
            "least_margin_sure": _lower(margin - error + round_off, w.least_margin_sure),
            "least_margin_possible": _lower(possible, w.least_margin_possible),
            "overdraft_time": cs.if_else(overdrawn, time, w.overdraft_time),
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


def _lower(value: cs.SX, kept: cs.SX) -> cs.SX:
    """Return the lower of two; what is no number, or that of a run that leaves them, lowers nothing."""
    return cs.if_else(cs.logic_and(value > -LARGEST, value < kept), value, kept)
