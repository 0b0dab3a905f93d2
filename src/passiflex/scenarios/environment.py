"""What touches the end effector in a scenario, beside constant wrenches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from passiflex.scenarios.spans import TimeSpan
from passiflex.texts.quantity import Quantity

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.elements import AbstractElement


class Drag(TimeSpan):
    """The end effector moves through something that takes energy out, as in polishing."""

    kind: Literal["drag"] = Field(description="drag")
    viscous: Annotated[float, Quantity("N s/m", least=0)] = Field(default=0.0, description="N s/m")
    dry: Annotated[float, Quantity("N", least=0)] = Field(default=0.0, description="against the motion, N")

    def build(self) -> AbstractElement:
        """Return the element."""
        from passiflex.elements import Drag

        return Drag()

    @property
    def acts(self) -> bool:
        """Return whether it does anything."""
        return any(self.inputs.values())

    @property
    def inputs(self) -> dict[str, float]:
        """Return the inputs of the element while it lasts."""
        return {"viscous_drag": self.viscous, "dry_drag": self.dry}


Touching = Drag
"""What an entry of `environment` may be."""


def as_drags(written: Any) -> Any:
    """Return entries of `drags`, as `environment` was called when there was nothing else, with their kind."""
    if not isinstance(written, list | tuple):
        return written
    return [{"kind": "drag"} | dict(e) if isinstance(e, Mapping) else e for e in written]
