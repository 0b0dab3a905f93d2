"""What one simulation is: robot, law, tank, reference, forces, model errors, noise; in SI units."""

from __future__ import annotations

from typing import Annotated, Any, Self

import yaml
from pydantic import AliasChoices, Field, ValidationInfo, field_validator, model_validator

from passiflex.scenarios.action_settings import Actions, Feedforward
from passiflex.scenarios.carried import Payload, Tool
from passiflex.scenarios.control_settings import (
    Control,
    GainChange,
    change_mistakes,
    gain_mistakes,
)
from passiflex.scenarios.environment import Touching, as_drags, labelled
from passiflex.scenarios.events import ReferenceEvent, event_mistakes, turning
from passiflex.scenarios.forces import AnyForce, Force, WrenchTable, as_forces
from passiflex.scenarios.law_settings import LawSettings
from passiflex.scenarios.model_errors import Deviations, ModelErrors
from passiflex.scenarios.motor_settings import MotorSettings
from passiflex.scenarios.noise_settings import Noise
from passiflex.scenarios.posture import StartPosture
from passiflex.scenarios.row_interval import fitting_interval, interval_mistake
from passiflex.scenarios.sensor_settings import SensorSettings
from passiflex.scenarios.setpoints import Table, as_events
from passiflex.scenarios.spans import Seconds
from passiflex.scenarios.tank_settings import TankSettings
from passiflex.scenarios.touching import Hand
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section


def _begins(entry: Any) -> tuple[str, float]:
    """Return the entry that says when something begins, and that [s]."""
    if isinstance(entry, GainChange):
        return "at", entry.at
    return entry.begins if isinstance(entry, Force | WrenchTable) else ("from", entry.lasts[0])


def _own_tank(data: dict[str, Any]) -> TankSettings | None:
    law = data.get("law")
    if law is None or not law.shapes:
        return None
    return TankSettings().completed("port" if data.get("control") else "paper")


QUICK_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""That of LibYAML where there is one: a campaign writes down each of its samples."""
WITH_CONTROL = ("sensors", "actions", "gain_changes", "feedforward")
"""Entries of a scenario that only a sampled run has."""


class Scenario(Section):
    """One simulation, complete: with the package's version it gives the same result again."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_.-]+$",
        max_length=100,
        description="name of the run: letters, digits, and any of _ . -",
    )
    description: str = Field(default="", description="what it shows")
    robot: str = Field(min_length=1, description="name in the catalogue, or path of a robot file (.yaml)")
    tool: Tool = Field(default=Tool(), description="end effector, seen from the robot's own")
    payload: Payload | None = Field(default=None, description="what the arm has picked up")
    posture: StartPosture = Field(
        description="joint angles at the start, at rest, rad; or `{pose: {position: ...}}`, for which they are found"
    )
    law: LawSettings = Field(description="control law")
    control: Control | None = Field(
        default=None, description="a controller that samples; continuous time if left out"
    )
    tank: TankSettings | None = Field(
        default_factory=_own_tank, description="energy tank; with the impedance law only"
    )
    duration: Seconds = Field(description="simulated time, s")
    reference: tuple[ReferenceEvent, ...] = Field(
        default=(), description="what the reference does, in the order of time; or `{table: FILE.csv}`"
    )
    forces: tuple[AnyForce, ...] = Field(
        default=(), description="external forces on the end effector; an entry may be `{table: FILE.csv}`"
    )
    deviations: Deviations = Field(
        default=Deviations(), description="by how much the robot differs from its description"
    )
    model_errors: ModelErrors = Field(
        default=ModelErrors(), description="by how much the law's model differs from the robot's description"
    )
    noise: Noise | None = Field(
        default=None,
        description="noise of the sensors; the rigid law does not use the joint torque; none if left out",
    )
    sensors: SensorSettings | None = Field(default=None, description="sensors, with control only")
    motors: MotorSettings | None = Field(default=None, description="motors; limits with control only")
    actions: Actions | None = Field(default=None, description="gated actions, with control only")
    gain_changes: tuple[GainChange, ...] = Field(
        default=(),
        validation_alias=AliasChoices("gain_changes", "gains"),
        description="changes of K_x and D_x in the order of time, with control only",
    )
    feedforward: tuple[Feedforward, ...] = Field(
        default=(), description="wrenches that the end effector is to exert, with control only"
    )
    environment: tuple[Touching, ...] = Field(
        default=(),
        validation_alias=AliasChoices("environment", "drags"),
        description="what touches the end effector",
    )
    hand: Hand = Field(default=Hand(), description="where the end effector may touch surfaces")
    output_interval: Seconds = Field(
        default_factory=fitting_interval,
        validate_default=True,
        description="time between two rows of the result, s; with control a whole multiple of the period, "
        "without it of noise.hold; the one nearest to 0.005 s if left out",
    )
    tolerance: Annotated[float, Quantity("1", least=1e-13, most=1e-3)] = Field(
        default=1e-9, description="relative tolerance of the integrator"
    )
    seed: int = Field(default=0, ge=0, strict=True, description="seed of the noise")

    @model_validator(mode="before")
    @classmethod
    def _drags_with_their_kind(cls, written: Any) -> Any:
        if not isinstance(written, dict):
            return written
        return {name: cls.from_former(name, value) for name, value in written.items()}

    @classmethod
    def from_former(cls, name: str, written: Any) -> Any:
        """Return what was written for an entry by its former name as the entry takes it by its new one."""
        return as_drags(written) if name == "drags" else written

    @field_validator("environment")
    @classmethod
    def _of_different_names(cls, environment: tuple[Touching, ...]) -> tuple[Touching, ...]:
        labelled(environment)
        return environment

    @field_validator("tank")
    @classmethod
    def _tank_of_the_law(cls, tank: TankSettings | None, info: ValidationInfo) -> TankSettings | None:
        if tank is None:
            return None
        if "law" in info.data and not info.data["law"].shapes:
            raise ValueError("only the impedance law has a tank; remove it, or take law type: impedance")
        sampled = info.data.get("control", "in error") is not None
        if not sampled and tank.kind not in (None, "paper"):
            raise Mistakes(
                (("kind",), f"a tank of kind {tank.kind} needs `control`, a rate at which it runs")
            )
        if "law" in info.data:
            tank.require(info.data["law"].gravity)
        tank = tank.completed("port" if sampled else "paper")
        if "control" in info.data:
            tank.require_used(sampled=sampled)
        return tank

    @field_validator("control")
    @classmethod
    def _control_of_the_law(cls, control: Control | None, info: ValidationInfo) -> Control | None:
        if control is None or "law" not in info.data:
            return control
        if not info.data["law"].shapes:
            if control.inner_loop == "matched":
                raise Mistakes((("inner_loop",), "the rigid law has no inner loop; take plain"))
            if control.task_periods > 1:
                raise Mistakes((("task_rate",), "the rigid law has no inner loop; leave it out"))
            return control
        found = gain_mistakes(control.fallback, info.data["law"].task, info.data["law"].stiffness.free)
        if found:
            raise Mistakes(*((("fallback", *place), text) for place, text in found))
        return control

    @model_validator(mode="after")
    def _tool_axes_only_sampled(self) -> Self:
        found = [name for name in ("stiffness", "damping") if getattr(self.law, name).in_tool]
        if self.control is None and found:
            raise Mistakes(
                *(
                    (("law", name, "axes"), "tool needs `control`, in which each turn of them is paid for")
                    for name in found
                )
            )
        return self

    @model_validator(mode="after")
    def _tank_with_a_use(self) -> Self:
        gating = self.control is None or self.actions or self.feedforward
        try:
            if self.tank is not None and not gating:
                self.tank.require_gated()
        except Mistakes as mistakes:
            raise Mistakes(*((("tank", *place), text) for place, text in mistakes.entries)) from None
        return self

    @field_validator(*WITH_CONTROL)
    @classmethod
    def _only_sampled(cls, entry: Any, info: ValidationInfo) -> Any:
        if entry and "control" in info.data and info.data["control"] is None:
            raise ValueError("needs `control`: only a sampled run has it")
        return entry

    @field_validator("motors")
    @classmethod
    def _limits_only_sampled(cls, motors: MotorSettings | None, info: ValidationInfo) -> MotorSettings | None:
        if motors is not None and "control" in info.data and info.data["control"] is None:
            motors.require_unlimited()
        return motors

    @field_validator("gain_changes")
    @classmethod
    def _gains_of_the_task(
        cls, changes: tuple[GainChange, ...], info: ValidationInfo
    ) -> tuple[GainChange, ...]:
        law = info.data.get("law")
        found = change_mistakes(changes, law.task, law.stiffness.free) if law else []
        if changes and any(isinstance(e, Table) and e.changes_gains for e in info.data.get("reference", ())):
            raise ValueError("a table of the reference has gains too; keep one of the two")
        if found:
            raise Mistakes(*found)
        return changes

    @field_validator("noise")
    @classmethod
    def _whole_periods(cls, noise: Noise | None, info: ValidationInfo) -> Noise | None:
        control = info.data.get("control")
        if noise is None:
            return None
        if info.data.get("control", "in error") is None:
            noise.require_torque_only()
        return noise.fitted(control.rate) if control is not None else noise

    @field_validator("sensors")
    @classmethod
    def _not_too_late(cls, sensors: SensorSettings | None, info: ValidationInfo) -> SensorSettings | None:
        if sensors is not None and (control := info.data.get("control")) is not None:
            sensors.require_soon(control.rate)
        return sensors

    @field_validator("forces", mode="before")
    @classmethod
    def _force_alone(cls, written: Any) -> Any:
        return as_forces(written)

    @field_validator("reference", mode="before")
    @classmethod
    def _table_alone(cls, written: Any) -> Any:
        return as_events(written)

    @field_validator("reference")
    @classmethod
    def _in_order(cls, events: tuple[Any, ...], info: ValidationInfo) -> tuple[Any, ...]:
        law, end = info.data.get("law"), info.data.get("duration", float("inf"))
        if found := event_mistakes(
            events, law, end, sampled=info.data.get("control", "in error") is not None
        ):
            raise Mistakes(*found)
        return events

    @field_validator("forces", "gain_changes", "feedforward", "environment")
    @classmethod
    def _within_the_run(cls, entries: tuple[Any, ...], info: ValidationInfo) -> tuple[Any, ...]:
        end = info.data.get("duration", float("inf"))
        begin = [_begins(e) for e in entries]
        needs = f"needs to be earlier than the end, {end:g} s"
        late = [((i, name), f"{needs}; got {t:g} s") for i, (name, t) in enumerate(begin) if not t < end]
        if late:
            raise Mistakes(*late)
        return entries

    @model_validator(mode="after")
    def _lost_within_the_run(self) -> Self:
        bursts = self.control.lost if self.control else ()
        needs = f"needs to be earlier than the end, {self.duration:g} s"
        late = [(i, burst.at) for i, burst in enumerate(bursts) if not burst.at < self.duration]
        if late:
            raise Mistakes(*((("control", "lost", i, "at"), f"{needs}; got {t:g} s") for i, t in late))
        return self

    @field_validator("output_interval")
    @classmethod
    def _whole_samples(cls, interval: float, info: ValidationInfo) -> float:
        if mistake := interval_mistake(interval, info.data):
            raise ValueError(mistake)
        return interval

    @property
    def gains_change(self) -> bool:
        """Return whether K_x or D_x change in flight: by a change, a table's rows, or in tool axes that turn."""
        in_tool = self.law.stiffness.in_tool or self.law.damping.in_tool
        tables = any(isinstance(e, Table) and e.changes_gains for e in self.reference)
        return bool(self.gain_changes) or tables or (in_tool and any(turning(e) for e in self.reference))

    def to_yaml(self) -> str:
        """Return the text of a file that loads to an equal scenario: complete and in SI units."""
        data = self.model_dump(by_alias=True, exclude_none=True)
        layout: dict[str, Any] = {"sort_keys": False, "allow_unicode": True, "default_flow_style": None}
        return str(yaml.dump(data, Dumper=QUICK_DUMPER, width=110, **layout))
