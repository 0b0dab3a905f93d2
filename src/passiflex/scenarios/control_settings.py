"""The settings of a sampled run in a scenario file: controller, sensors, motors, and what users add. SI units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import AliasChoices, BeforeValidator, Field, model_validator

from passiflex.scenarios.gain_settings import (
    Damping,
    ShapedInertia,
    ShapedStiffness,
    Stiffness,
    free_mistakes,
)
from passiflex.scenarios.noise_settings import is_multiple
from passiflex.scenarios.spans import Instant
from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Mistakes, Section

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.sampled.external import AbstractExternalTorque
    from passiflex.sampled.held_task import HeldTask
    from passiflex.sampled.inner_loop import AbstractInnerLoop

Vector = tuple[float, ...]
Found = list[tuple[tuple[str | int, ...], str]]
"""Mistakes, each with its place."""
Frequency = Annotated[float, Quantity("Hz", above=0, finite=False)]
Share = Annotated[float, Quantity("1", least=0, most=1)]
PerJoint = ((), (None,))
ENDLESS = float("inf")
NOW = 1e-9
"""Two instants closer than this are one [s]."""
MOST_PERIODS = 60
"""Longest delay, in control periods: 15 ms at 4 kHz. So many commands are on their way."""
MOST_PREDICTED = 20
"""The same for an inner loop that predicts over each of them: its code grows with them."""


def _flag(written: Any) -> bool:
    if not isinstance(written, bool):
        raise ValueError(f"expected true or false; got {shown(written)}")
    return written


class Fallback(Section):
    """The law that takes over, for good, once the port tank is overdrawn: it holds the pose just read."""

    shaped_stiffness: ShapedStiffness = Field(
        default=ShapedStiffness(ratio=1.0), description="its K_e: {ratio: multiple of K}, or in N m/rad"
    )
    shaped_inertia: ShapedInertia = Field(
        default=ShapedInertia(ratio=1.0), description="its B_e: {ratio: multiple of B}, or in kg m^2"
    )
    stiffness: Stiffness | None = Field(default=None, description="its K_x; the law's own if left out")
    damping: Damping | None = Field(default=None, description="its D_x; the law's own if left out")


class Burst(Section):
    """Periods in a row in which the law does not run, as where packets are lost."""

    at: Instant = Field(description="when the first of them is due, s")
    periods: int = Field(ge=1, le=1_000_000, strict=True, description="how many they are")


class Control(Section):
    """The law runs once per period; its command is held until the next one arrives."""

    rate: Annotated[float, Quantity("Hz", above=0, most=1e6)] = Field(description="control rate, Hz")
    task_rate: Annotated[float, Quantity("Hz", above=0, most=1e6)] | None = Field(
        default=None,
        description="rate of the outer loop, Hz, whose torque is held for the inner one in between; "
        "that of control if left out",
    )
    delay: Instant = Field(
        default=0.0,
        description="from a sample to the arrival of its command, s; at most 60 periods; 20 with the matched inner "
        "loop, which predicts over whole ones",
    )
    jitter: Instant = Field(
        default=0.0, description="each command is late by up to this much more, uniformly, s"
    )
    missed: Annotated[float, Quantity("1", least=0, most=0.9)] = Field(
        default=0.0, description="share of periods in which the law does not run, at random"
    )
    lost: tuple[Burst, ...] = Field(
        default=(), description="bursts of periods in which it does not run either, as a log has them"
    )
    inner_loop: Literal["plain", "matched"] = Field(
        default="plain",
        description="plain: the continuous law at the sample; matched: predicted over the delay, and matched "
        "to the shaped motor at the end of the hold",
    )
    external_torque: Literal["true", "measured", "observer", "none"] = Field(
        default="measured",
        description="τ_e of the law: the truth, the wrench sensor's, a momentum observer's, or none",
    )
    observer_bandwidth: Frequency = Field(default=50.0, description="pole of the momentum observer, Hz")
    fallback: Fallback = Field(
        default=Fallback(), description="the law that takes over when the tank is overdrawn"
    )
    allow_unstable: Annotated[bool, BeforeValidator(_flag)] = Field(
        default=False,
        validation_alias=AliasChoices("allow_unstable", "insist"),
        description="run the law even at a rate and delay at which it is unstable",
    )

    def build_external(self) -> AbstractExternalTorque:
        """Return where the law's τ_e comes from."""
        from passiflex.sampled import external as e

        kinds: dict[str, Callable[[], AbstractExternalTorque]] = {
            "true": e.TrueTorque,
            "measured": e.MeasuredWrench,
            "observer": e.MomentumObserver,
            "none": e.NoTorque,
        }
        return kinds[self.external_torque]()

    def build_inner(self) -> AbstractInnerLoop:
        """Return the inner loop, for this delay."""
        from passiflex.sampled.inner_loop import PlainInnerLoop
        from passiflex.sampled.matched_loop import MatchedInnerLoop

        return {"plain": PlainInnerLoop, "matched": MatchedInnerLoop}[self.inner_loop]().expecting(
            round(self.delay * self.rate)
        )

    @property
    def task_periods(self) -> int:
        """Return how many periods there are from one run of the outer loop to the next."""
        return 1 if self.task_rate is None else round(self.rate / self.task_rate)

    def build_task(self) -> HeldTask | None:
        """Return what holds the torque of a slower outer loop."""
        from passiflex.sampled.held_task import HeldTask

        return HeldTask() if self.task_periods > 1 else None

    @model_validator(mode="after")
    def _slower_task(self) -> Self:
        if self.task_rate is None:
            return self
        if not is_multiple(self.rate / self.task_rate):
            needs = f"rate, {self.rate:g} Hz, needs to be a whole multiple of it"
            raise Mistakes((("task_rate",), f"{needs}; got {self.task_rate:g} Hz"))
        if self.task_periods > 1 and self.inner_loop == "matched":
            holds = "the matched inner loop holds the damping of the outer one in its own clock"
            raise Mistakes((("inner_loop",), f"{holds}; with task_rate take plain"))
        if self.task_periods > 1 and self.missed:
            judged = "periods missed at random are judged for one rate only"
            raise Mistakes((("missed",), f"{judged}; take lost bursts, or leave task_rate out"))
        return self

    @model_validator(mode="after")
    def _few_on_their_way(self) -> Self:
        periods = (self.delay + self.jitter) * self.rate
        predicts = self.inner_loop == "matched"
        most, whose = (MOST_PREDICTED, " with the matched inner loop") if predicts else (MOST_PERIODS, "")
        if periods > most:
            written = "delay" if "delay" in self.model_fields_set else "jitter"
            needs = f"delay and jitter together are at most {most} periods{whose}"
            raise Mistakes(((written,), f"{needs}; got {periods:.4g} periods"))
        return self


class GainChange(Section):
    """K_x and D_x go over to other values: smoothly (minimum jerk) and without a bump, or at once."""

    at: Instant = Field(description="when it begins, s")
    duration: Instant = Field(description="how long it takes, s; 0: at once")
    stiffness: Stiffness | None = Field(default=None, description="K_x at the end; stays if left out")
    damping: Damping | None = Field(default=None, description="D_x at the end; stays if left out")


def change_mistakes(changes: Sequence[GainChange], task: str, free: tuple[int, ...]) -> Found:
    """Return what of the changes overlaps, or does not fit the task."""
    found: Found = []
    for i, change in enumerate(changes):
        before = changes[i - 1]
        if i and change.at <= before.at + NOW and not before.duration:
            found.append(
                ((i, "at"), f"needs to be later than the one before, {before.at:g} s; got {change.at:g} s")
            )
        elif i and not change.at >= before.at + before.duration - NOW:
            found.append(((i, "at"), f"the change before lasts longer; got {change.at:g} s"))
        found += [((i, *place), text) for place, text in gain_mistakes(change, task, free)]
    return found


def gain_mistakes(given: Fallback | GainChange, task: str, free: tuple[int, ...]) -> Found:
    """Return what of the gains does not fit the task, whose axes `free` they have to leave free."""
    found: Found = []
    if given.damping is not None and given.damping.ratio is not None:
        found.append((("damping",), "a damping ratio belongs to one posture; give D_x itself"))
    for name, part in (("stiffness", given.stiffness), ("damping", given.damping)):
        try:
            if part is None:
                continue
            if part.in_tool and isinstance(given, Fallback):
                raise Mistakes(
                    (("axes",), "the fallback holds one pose; give its gains in axes of the world")
                )
            part.require(task)
        except Mistakes as mistakes:
            found += [((name, *place), text) for place, text in mistakes.entries]
        else:
            found += [((name,), text) for text in [free_mistakes(part, free)] if text]
    return found
