"""What the end effector may touch, in MuJoCo: a geom of the world and spheres of the hand, with a stiffness in N/m.

MuJoCo's contact takes no stiffness. Its solver makes the force f of a constraint obey R f = a_ref − a, with a the
acceleration at the contact, a_ref = −b v − k r, and R = A (1 − d) / d, where d is the impedance and A an inverse
inertia that the compiler takes at the zero posture. With d constant and small, k = K R and b = B R this is

    f = max(0, K depth + B rate − a / R)

a spring of K N/m and a damper of B N s/m, but for a mass of 1/R, `IMPEDANCE` times the hand's own. Friction is dry,
with the limit μ f as a cone; below it the contact creeps, by the `impratio` of `CREEP`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.elements import AbstractElement
from passiflex.elements.normal import HuntCrossley
from passiflex.elements.shapes import AbstractShape, Box, Cylinder, Plane, Sphere
from passiflex.elements.surface import Surface
from passiflex.engines.mjcf import Piece, quaternion, said
from passiflex.errors import ValueRangeError

Array = NDArray[np.float64]

IMPEDANCE = 2e-4
"""d; MuJoCo takes 1e-4 at least."""
CREEP = 1e6
"""Ratio of the impedances of friction and normal force."""


class Contact(NamedTuple):
    """Something that the hand may touch.

    Attributes
    ----------
    shape, sizes: Type and size of the geom, as MJCF has them.
    place, axes: Of the geom, in world axes.
    stiffness, damping: K [N/m], B [N s/m], along the normal.
    crossing: c [s/m] of a damper that grows with the depth, B = c K depth (Hunt and Crossley).
    friction: μ.
    points, roundness: Centres (k, 3) [m] of the hand's spheres, in the axes of the end effector, and their radius [m].
    """

    shape: str
    sizes: tuple[float, ...]
    place: Array
    axes: Array
    stiffness: float
    damping: float
    crossing: float
    friction: float
    points: Array
    roundness: float


@singledispatch
def contact_of(element: AbstractElement, numbers: Mapping[str, Any]) -> Contact | None:
    """Return what an element is in MuJoCo, with its numbers by name; None for one that is a force of the state alone.

    This is where a kind of element says how MuJoCo is to make it: `contact_of.register`.
    """
    return None


@contact_of.register
def _(element: Surface, numbers: Mapping[str, Any]) -> Contact:
    g = {name: numbers[f"{element.label}_{name}"] for name in MADE if f"{element.label}_{name}" in numbers}
    if element.moved or float(g["viscous"]):
        raise ValueRangeError(
            f"the engine mujoco knows no surface as {element.label!r}",
            got="one that moves" if element.moved else "viscous friction",
            needs="one at rest, with dry friction or none",
            try_="the engine passiflex",
        )
    crossing = isinstance(element.normal, HuntCrossley)
    damping = float(g["damping"])
    kind, names = SHAPES[type(element.shape)]
    sizes = [float(numbers[f"{element.label}_{name}"]) for name in names]
    return Contact(
        shape=kind,
        sizes=tuple(min(size, LONGEST) for size in sizes) or (1.0, 1.0, 0.1),
        place=np.asarray(g["place"]),
        axes=np.asarray(g["axes"]),
        stiffness=float(g["stiffness"]),
        damping=0.0 if crossing else damping,
        crossing=damping if crossing else 0.0,
        friction=float(g.get("friction", 0.0)),
        points=np.reshape(g["points"], (-1, 3)),
        roundness=float(g["roundness"]),
    )


MADE = ("place", "axes", "stiffness", "damping", "viscous", "friction", "points", "roundness")
"""What a contact is made of, of the numbers of a surface."""
SHAPES: dict[type[AbstractShape], tuple[str, tuple[str, ...]]] = {
    Plane: ("plane", ()),
    Sphere: ("sphere", ("radius",)),
    Cylinder: ("cylinder", ("radius", "half_length")),
    Box: ("box", ("half_x", "half_y", "half_z")),
}
"""Shape → type of the geom, and its sizes by their names."""
LONGEST = 100.0
"""Size of what has no end [m]."""


def surface_geom(name: str) -> str:
    """Return the name of the geom of an element in the world."""
    return f"{name}_surface"


def hand_geom(name: str, point: int) -> str:
    """Return the name of a geom of the hand."""
    return f"{name}_hand_{point}"


def contact_piece(name: str, contact: Contact, stiff: Any = None) -> Piece:
    """Return the parts of a model.

    Parameters
    ----------
    stiff: The model of the same parts after `stiffen`, whose factors are written into these; without it they have none.
    """
    d, mu = IMPEDANCE, contact.friction
    surface = surface_geom(name)
    world = (
        f'<geom name="{surface}" type="{contact.shape}" size="{said(contact.sizes)}" pos="{said(contact.place)}"'
        f' quat="{quaternion(contact.axes)}" rgba="0.6 0.7 0.8 0.6"/>'
    )
    tip = "".join(
        f'<geom name="{hand_geom(name, i)}" type="sphere" size="{said(max(contact.roundness, SHARP))}"'
        f' pos="{said(point)}"/>'
        for i, point in enumerate(contact.points)
    )
    pairs = "".join(
        f'<pair name="{hand_geom(name, i)}" geom1="{surface}" geom2="{hand_geom(name, i)}"'
        f' condim="{3 if mu else 1}" friction="{said([mu, mu, 0, 0, 0])}" solimp="{d} {d} 1 0.5 1"'
        f"{_factors(stiff, hand_geom(name, i))}/>"
        for i in range(len(contact.points))
    )
    return Piece(world, tip, f"<contact>{pairs}</contact>")


def _factors(stiff: Any, pair: str) -> str:
    if stiff is None:
        return ""
    i = stiff.pair(pair).id
    return f' solref="{said(stiff.pair_solref[i])}" solreffriction="{said(stiff.pair_solreffriction[i])}"'


SHARP = 1e-9
"""Radius of the hand's sphere where it is a point [m]."""


def stiffen(model: Any, name: str, contact: Contact) -> None:
    """Give the pairs of a contact their stiffness and damping."""
    for i in range(len(contact.points)):
        pair = model.pair(hand_geom(name, i)).id
        bodies = (model.geom_bodyid[g] for g in (model.pair_geom1[pair], model.pair_geom2[pair]))
        inverse = sum(model.body_invweight0[body, 0] for body in bodies)
        share = (1 - IMPEDANCE) * inverse
        model.pair_solref[pair] = -contact.stiffness * share, -contact.damping * share
        model.pair_solreffriction[pair] = 0.0, -IMPEDANCE / (2 * model.opt.timestep)
