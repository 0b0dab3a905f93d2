"""What touches the end effector in a scenario, beside wrenches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from passiflex.scenarios.spans import TimeSpan
from passiflex.scenarios.surface_settings import Box, Cylinder, Plane, Sphere
from passiflex.scenarios.touching import KINDS, AbstractTouching, Change, Hand
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.control.motion import Pose
    from passiflex.elements import AbstractElement


class Drag(TimeSpan, AbstractTouching):
    """The end effector moves through something that takes energy out, as in polishing."""

    kind: Literal["drag"] = Field(description=KINDS)
    viscous: Annotated[float, Quantity("N s/m", least=0)] = Field(default=0.0, description="N s/m")
    dry: Annotated[float, Quantity("N", least=0)] = Field(default=0.0, description="against the motion, N")

    def build(self, label: str, at: Pose, hand: Hand) -> AbstractElement:
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


Touching = Annotated[Drag | Plane | Sphere | Cylinder | Box, Field(discriminator="kind")]
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
