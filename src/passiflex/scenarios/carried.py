"""What the arm carries: its tool, and what it has picked up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from passiflex.scenarios.reference import ZERO, Length, Turn
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

if TYPE_CHECKING:
    from passiflex.robots.bodies import Body


class Carried(Section):
    """A body on the flange: in the axes of the robot's own end effector."""

    mass: Annotated[float, Quantity("kg", least=0)] = Field(default=0.0, description="kg")
    centre: Length = Field(default=ZERO, description="its centre of mass, in the axes of the robot's own, m")
    inertia: Annotated[tuple[float, ...], Quantity("kg m^2", ((3,), (6,)))] = Field(
        default=ZERO,
        description="about its centre of mass: Ixx, Iyy, Izz, or all six with Ixy, Ixz, Iyz, kg m^2",
    )

    @property
    def body(self) -> Body:
        """Return the body."""
        from passiflex.robots.bodies import Body

        xx, yy, zz, xy, xz, yz = self._moments
        return Body(self.mass, np.array(self.centre), np.array([xx, xy, xz, yy, yz, zz]))

    @property
    def _moments(self) -> tuple[float, ...]:
        return (*self.inertia, 0.0, 0.0, 0.0)[:6]

    @model_validator(mode="after")
    def _of_matter(self) -> Self:
        if not any(self.inertia):  # and no robot is needed to read the scenario
            return self
        from passiflex.robots.bodies import PRINTED, matrix, triangle_defect

        moments = np.linalg.eigvalsh(matrix(self.body.inertia))
        if moments[0] < 0 or triangle_defect(self.body, PRINTED):
            needs = "three moments, none larger than the sum of the others"
            raise Mistakes(
                (("inertia",), f"is of no body: principal moments {moments.round(6).tolist()}; {needs}")
            )
        if self.mass == 0:
            raise Mistakes((("mass",), "is 0, but there is an inertia"))
        return self


class Tool(Carried):
    """Where the end effector is, seen from the robot's own, and what is mounted there, which the law knows."""

    position: Length = Field(
        default=ZERO, description="offset of the end effector, in the axes of the robot's own, m"
    )
    rotation_vector: Turn = Field(default=ZERO, description="turn of the end effector's axes, rad")


class Payload(Carried):
    """What the arm has picked up: it is there, and the law knows of it or not."""

    known: bool = Field(default=False, description="whether the law's model has it too")
