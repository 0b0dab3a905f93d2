"""The entries of a robot's YAML file: links, mount, and the numbers of its joints with units and sources."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    StringConstraints,
    ValidationInfo,
    field_validator,
    model_validator,
)
from scipy.spatial.transform import Rotation

from passiflex.robots.bodies import rotation_of
from passiflex.texts.quantity import Quantity, shown
from passiflex.texts.section import Mistakes, Section

Array = NDArray[np.float64]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]

DEGREE = np.pi / 180.0

UNITS: dict[str, dict[str, dict[str, float]]] = {
    "joint_stiffness": {
        "revolute": {"N m/rad": 1.0, "kN m/rad": 1e3, "N m/deg": 1 / DEGREE},
        "prismatic": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3},
    },
    "joint_damping": {
        "revolute": {"N m s/rad": 1.0, "N m s/deg": 1 / DEGREE},
        "prismatic": {"N s/m": 1.0, "N s/mm": 1e3},
    },
    "motor_inertia": {
        "revolute": {"kg m^2": 1.0, "kg cm^2": 1e-4},
        "prismatic": {"kg": 1.0},
    },
    "torque_limit": {
        "revolute": {"N m": 1.0},
        "prismatic": {"N": 1.0, "kN": 1e3},
    },
    "velocity_limit": {
        "revolute": {"rad/s": 1.0, "deg/s": DEGREE},
        "prismatic": {"m/s": 1.0, "mm/s": 1e-3},
    },
    "position_limit": {
        "revolute": {"rad": 1.0, "deg": DEGREE},
        "prismatic": {"m": 1.0, "mm": 1e-3},
    },
}
"""Entry → kind of joint → usual units, the first one SI → factor to SI. Others go by the parser of units."""


OF_URDF = {"torque_limit": "effort", "velocity_limit": "velocity", "position_limit": ""}
"""Entries that a URDF has, if not the file itself, and what it calls them."""
MOUNTS = {"floor": (0.0, 0.0, 0.0), "wall": (0.0, np.pi / 2, 0.0), "ceiling": (np.pi, 0.0, 0.0)}
"""Word for a mount → roll, pitch and yaw of the base; on a wall its x points down."""


class Mount(Section):
    """How the base is mounted in a world whose z points up: a word, roll, pitch and yaw, or gravity in its axes."""

    ways: ClassVar[tuple[tuple[str, ...], ...]] = (("on",), ("rpy",), ("gravity",))
    on: Literal["floor", "wall", "ceiling"] | None = Field(
        default=None, description="what the base is bolted to"
    )
    rpy: Annotated[tuple[float, ...], Quantity("rad", ((3,),))] | None = Field(
        default=None, description="roll, pitch and yaw of the base, rad"
    )
    gravity: Annotated[tuple[float, ...], Quantity("m/s^2", ((3,),))] | None = Field(
        default=None, description="in the axes of the base, whatever its length, m/s^2"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if len(self.model_fields_set & {"on", "rpy", "gravity"}) > 1:
            raise Mistakes(((), "expected one of on, rpy, gravity"))
        if self.gravity is not None and not any(self.gravity):
            raise Mistakes((("gravity",), "has no direction"))
        return self

    def rotation(self, described: Array) -> Array:
        """Return the axes of the base as columns; those of the URDF where nothing is said."""
        if self.gravity is not None:
            down = np.array(self.gravity) / np.linalg.norm(self.gravity)
            return np.asarray(Rotation.align_vectors([[0, 0, -1]], [down])[0].as_matrix())
        rpy = MOUNTS[self.on] if self.on else self.rpy
        return described if rpy is None else rotation_of(np.array(rpy))


class Entry(Section):
    """Numbers with their unit and their source; one number or unit serves all joints."""

    value: Any = Field(description="one number, or one for each joint")
    unit: Text | tuple[Text, ...] | None = Field(
        default=None, description="unit of all, or one for each joint"
    )
    source: Text = Field(description="where the numbers come from, or the word assumed")
    range: tuple[float, float] | None = Field(
        default=None, description="shares of the value between which the true one may be, as [0.5, 2]"
    )

    @field_validator("unit", mode="before")
    @classmethod
    def _texts(cls, written: Any) -> Any:
        if not all(isinstance(unit, str) and unit.strip() for unit in _leaves(written)):
            raise ValueError(f"expected text, or one for each joint; got {shown(written)}")
        return written


class Commanded(Section):
    """What commands the robot, and how often."""

    rate: Annotated[float, Quantity("Hz", above=0)] = Field(description="at which it is commanded, Hz")
    by: Text = Field(description="interface that does it")


class Entries(Section):
    """A robot as it stands in its YAML file; `source` is that of the links."""

    name: Text = Field(description="text")
    description: Text = Field(description="text")
    urdf: Text = Field(description="path of the URDF, absolute or from the folder of this file")
    base: Text | None = Field(
        default=None, description="link from which on joints move; the first one if left out"
    )
    end_effector: Text | None = Field(
        default=None, description="link that is held; the last one of the longest chain if left out"
    )
    frozen: dict[str, Any] = Field(
        default={},
        description="where other joints stand, by name, rad or m; 0 if left out, or amid a range without 0",
    )
    torque_sensors: bool = Field(default=True, description="whether it measures the torque in its joints")
    commanded: Commanded | None = Field(default=None, description="what commands it, and how often")
    mount: Mount = Field(default=Mount(), description="how the base is mounted; as in the URDF if left out")
    source: Text = Field(description="where the numbers of the links come from")
    joint_stiffness: Entry = Field(description="K, with value, unit and source")
    joint_damping: Entry = Field(description="D, with value, unit and source")
    motor_inertia: Entry = Field(description="B as seen at the link, with value, unit and source")
    torque_limit: Entry | None = Field(
        default=None,
        description="largest torque of the motors, as above; that of the URDF if left out",
    )
    velocity_limit: Entry | None = Field(
        default=None,
        description="largest speed of the joints, as above; that of the URDF if left out",
    )
    position_limit: Entry | None = Field(
        default=None,
        description="range of the joints, as above; that of the URDF if left out",
    )

    @field_validator(*UNITS, mode="before")
    @classmethod
    def _with_a_unit(cls, written: Any, info: ValidationInfo) -> Any:
        if written is None and info.field_name in OF_URDF:
            return None
        usual = next(iter(UNITS[info.field_name or ""]["revolute"]))
        if not isinstance(written, dict | Entry):
            named = any(isinstance(v, str) and not _is_number(v) for v in _leaves(written))
            value = shown(written) if isinstance(written, list) else written
            entry = f"{{value: {value}, {'' if named else f'unit: {usual}, '}source: ...}}"
            needs = "a source" if named else "a unit and a source"
            raise ValueError(f"needs {needs}; got {shown(written)}; try {entry}")
        return written

    @field_validator(*UNITS)
    @classmethod
    def _of_a_unit(cls, entry: Entry | None, info: ValidationInfo) -> Entry | None:
        if entry is None:
            return None
        if entry.unit is None and any(not isinstance(v, str) or _is_number(v) for v in _leaves(entry.value)):
            usual = next(iter(UNITS[info.field_name or ""]["revolute"]))
            raise Mistakes((("value",), f"needs a unit; got {shown(entry.value)}; try unit: {usual}"))
        return entry


def _leaves(written: Any) -> Iterator[Any]:
    for part in written if isinstance(written, list) else ():
        yield from _leaves(part)
    if not isinstance(written, list):
        yield written


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
