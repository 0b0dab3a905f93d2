"""The settings of a sampled run in a scenario file: controller, sensors, motors, and what users add. SI units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import AliasChoices, BeforeValidator, Field, model_validator

from passiflex.scenarios.gain_settings import (
    Damping,
    ShapedInertia,
    ShapedStiffness,
    Stiffness,
    free_mistakes,
)
from passiflex.scenarios.spans import Instant, TimeSpan
from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Mistakes, Section

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.sampled.external import AbstractExternalTorque
    from passiflex.sampled.inner_loop import AbstractInnerLoop

Vector = tuple[float, ...]
Found = list[tuple[tuple[str | int, ...], str]]
"""Mistakes, each with its place."""
Frequency = Annotated[float, Quantity("Hz", above=0, finite=False)]
Share = Annotated[float, Quantity("1", least=0, most=1)]
PerJoint = ((), (None,))
NAMED = ("none", "robot")
TorqueLimit = Annotated[str | float | Vector, Quantity("N m", PerJoint, above=0, names=NAMED)]
SpeedLimit = Annotated[str | float | Vector, Quantity("rad/s", PerJoint, above=0, names=NAMED)]
ENDLESS = float("inf")
NOW = 1e-9
"""Two instants closer than this are one [s]."""
MOST_PERIODS = 20
"""Longest delay, in control periods; a loop that is later controls nothing."""


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
    delay: Instant = Field(
        default=0.0,
        description="from a sample to the arrival of its command, s; the matched inner loop predicts over "
        "whole periods",
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

    @model_validator(mode="after")
    def _few_on_their_way(self) -> Self:
        periods = (self.delay + self.jitter) * self.rate
        if periods > MOST_PERIODS:
            written = "delay" if "delay" in self.model_fields_set else "jitter"
            raise Mistakes(
                (
                    (written,),
                    f"delay and jitter together are at most {MOST_PERIODS} periods; got {periods:.4g} periods",
                )
            )
        return self


class MotorSettings(Section):
    """What the motors make of a command; without it they give it exactly."""

    torque_limit: TorqueLimit = Field(
        default="none",
        description="largest torque: none, that of the robot's description, or in N m, one number or one each",
    )
    torque_rate_limit: Annotated[float | Vector, Quantity("N m/s", PerJoint, above=0, finite=False)] = Field(
        default=ENDLESS,
        description="fastest change of the torque, one number or one each, N m/s; inf for none",
    )
    speed_limit: SpeedLimit = Field(
        default="none",
        description="beyond which a motor is braked: none, that of the robot's description, or in rad/s, one number "
        "or one each",
    )
    friction: Literal["sticks", "smooth"] = Field(
        default="smooth",
        description="how coulomb_friction acts: it sticks, or it is smooth and creeps where it should stick",
    )
    coulomb_friction: Annotated[float | Vector, Quantity("N m", PerJoint, least=0)] = Field(
        default=0.0, description="at the motors, one number for all joints or one each, N m"
    )
    viscous_friction: Annotated[float | Vector, Quantity("N m s/rad", PerJoint, least=0)] = Field(
        default=0.0, description="at the motors, one number for all joints or one each, N m s/rad"
    )
    friction_width: Annotated[float, Quantity("rad/s", above=0)] = Field(
        default=0.01, description="speed over which Coulomb friction changes its sign, rad/s"
    )

    static_friction: Annotated[float, Quantity("1", least=1, most=10)] = Field(
        default=1.0, description="of friction that sticks, before it slips, as a multiple of coulomb_friction"
    )
    stribeck_speed: Annotated[float, Quantity("rad/s", above=0)] = Field(
        default=0.01, description="over which it falls from there to coulomb_friction, rad/s"
    )
    break_away: Annotated[float, Quantity("rad", above=0)] = Field(
        default=1e-4, description="by which a motor gives way before it slips, seen from the link, rad"
    )

    def require_unlimited(self) -> None:
        """Raise Mistakes for limits, which only a sampled run has."""
        said = {
            "torque_limit": self.torque_limit != "none",
            "torque_rate_limit": min(np.atleast_1d(self.torque_rate_limit)) < ENDLESS,
        }
        if found := [
            ((name,), "needs `control`: only a sampled run has it") for name, is_set in said.items() if is_set
        ]:
            raise Mistakes(*found)


class Actions(Section):
    """What is not passive, and only acts as far as the tank's valve is open."""

    posture_stiffness: Annotated[float | Vector, Quantity("N m/rad", PerJoint, least=0)] = Field(
        default=0.0, description="of a spring in the null space toward `posture`, N m/rad"
    )
    posture_damping: Annotated[float | Vector, Quantity("N m s/rad", PerJoint, least=0)] | None = Field(
        default=None,
        description="of the same motion, N m s/rad; a ratio of 0.7 of each joint at the start if left out",
    )
    posture: Annotated[Vector, Quantity("rad", ((None,),))] | None = Field(
        default=None, description="joint angles that this spring pulls to, rad; the start if left out"
    )
    follow_velocity: Share = Field(default=0.0, description="share of D_x ẋ_d that is fed forward, 0 to 1")
    follow_acceleration: Share = Field(default=0.0, description="share of Λ ẍ_d that is fed forward, 0 to 1")


class Feedforward(TimeSpan):
    """A wrench that the end effector is to exert for some time, as far as the valve is open."""

    force: Annotated[Vector, Quantity("N", ((3,),))] = Field(
        default=(0.0, 0.0, 0.0), description="force in world axes, N"
    )
    moment: Annotated[Vector, Quantity("N m", ((3,),))] = Field(
        default=(0.0, 0.0, 0.0), description="moment in world axes, N m"
    )


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
