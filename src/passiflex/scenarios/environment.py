"""What touches the end effector in a scenario, beside wrenches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from passiflex.errors import SizeError
from passiflex.scenarios.held_settings import Load, Person
from passiflex.scenarios.spans import TimeSpan
from passiflex.scenarios.surface_settings import Box, Cylinder, Plane, Sphere
from passiflex.scenarios.touching import KINDS, AbstractTouching, Change, Site
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.elements import AbstractElement


class Drag(TimeSpan, AbstractTouching):
    """The end effector moves through something that takes energy out, as in polishing."""

    kind: Literal["drag"] = Field(description=KINDS)
    viscous: Annotated[float, Quantity("N s/m", least=0)] = Field(default=0.0, description="N s/m")
    dry: Annotated[float, Quantity("N", least=0)] = Field(default=0.0, description="against the motion, N")

    def build(self, label: str, site: Site) -> AbstractElement:
        """Return the element; all drags are one."""
        from passiflex.elements import Drag

        return Drag()

    @property
    def acts(self) -> bool:
        """Return whether it does anything."""
        return bool(self.viscous or self.dry)

    def changes(self, label: str) -> Sequence[Change]:
        """Return its inputs while it lasts."""
        inputs = {"viscous_drag": self.viscous, "dry_drag": self.dry}
        return Change(self.start, inputs), Change(self.end, dict.fromkeys(inputs, 0.0))


class EndStops(AbstractTouching):
    """The joints have ends, and a link that comes to one is pressed back."""

    single: ClassVar[bool] = True
    kind: Literal["end_stops"] = Field(description=KINDS)
    stiffness: Annotated[float | tuple[float, ...], Quantity("N m/rad", ((), (None,)), above=0)] = Field(
        default=2e4, description="of the stops, one number or one each, N m/rad"
    )
    dissipation: Annotated[float, Quantity("s/rad", least=0)] = Field(
        default=1.0, description="of the stops, s/rad, as of a surface"
    )
    lower: Annotated[tuple[float, ...], Quantity("rad", ((None,),))] | None = Field(
        default=None, description="where they are, rad; the robot's position limits if left out"
    )
    upper: Annotated[tuple[float, ...], Quantity("rad", ((None,),))] | None = Field(
        default=None, description="and at the other end, rad"
    )

    @model_validator(mode="after")
    def _by_their_kind(self) -> Self:
        if self.name not in ("", self.usual):
            raise Mistakes(
                (("name",), f"a run calls them {self.usual}, as there is one of their kind; remove it")
            )
        return self

    def build(self, label: str, site: Site) -> AbstractElement:
        """Return the stops."""
        from passiflex.elements import EndStops

        robot, (lower, upper) = site.robot, site.robot.position_limit.T
        for name in ("stiffness", "lower", "upper"):
            value = getattr(self, name)
            if value is not None and np.size(value) not in (1, robot.n):
                raise SizeError(
                    f"environment: {name} of end_stops does not fit robot {robot.name!r}",
                    got=f"{np.size(value)} numbers",
                    needs=f"{robot.n}, one for each joint",
                )
        return EndStops(
            lower=lower if self.lower is None else self.lower,
            upper=upper if self.upper is None else self.upper,
            stiffness=self.stiffness,
            dissipation=self.dissipation,
        )

    @property
    def usual(self) -> str:
        """Return what a run calls them."""
        return "end_stops"


Touching = Annotated[
    Drag | Plane | Sphere | Cylinder | Box | Load | Person | EndStops, Field(discriminator="kind")
]
"""What an entry of `environment` may be."""


def labelled(environment: Sequence[AbstractTouching]) -> dict[str, AbstractTouching]:
    """Return the entries that act by what a run calls them: by their names, or their kinds and how many there were.

    Raises
    ------
    Mistakes
        For two of one name.
    """
    named: dict[str, AbstractTouching] = {}
    for i, entry in enumerate(environment):
        if not entry.acts:
            continue
        label, number = entry.name or entry.usual, 2
        if entry.single and any(type(e) is type(entry) for e in named.values()):
            raise Mistakes(((i, "kind"), f"there is another entry of kind {entry.usual}; there can be one"))
        if entry.name and label in named:
            raise Mistakes(((i, "name"), f"another entry has the name {label}"))
        while label in named:
            label, number = f"{entry.usual}_{number}", number + 1
        named[label] = entry
    return named


def as_drags(written: Any) -> Any:
    """Return entries of `drags`, as `environment` was called when there was nothing else, with their kind."""
    if not isinstance(written, list | tuple):
        return written
    return [{"kind": "drag"} | dict(e) if isinstance(e, Mapping) else e for e in written]
