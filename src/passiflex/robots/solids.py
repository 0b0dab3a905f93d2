"""An arm as clean solids, made from its kinematics alone: what a viewer draws where there are no meshes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from passiflex.robots.bodies import Array, rotation_of
from passiflex.robots.chain import SerialChain
from passiflex.robots.urdf_parts import Joint

SLIM, STOUT = 0.05, 0.35
"""The radius at the base is the smaller of these shares: of the length of the whole arm, of its middle link."""
WRIST = 0.6
"""Radius of the last link, as a share of that at the base."""
LENGTHLESS = 0.3
"""Length [m] that an arm without any length is drawn for."""
COLOURS = {"link": "0.78 0.80 0.83 1", "joint": "0.24 0.30 0.38 1", "tool": "0.90 0.62 0.00 1"}


class Solid(NamedTuple):
    """A solid of revolution in the frame of its body; start, end (3,) and radius in m.

    A capsule is a cylinder from start to end with a half sphere on either end; a sphere has start == end.
    `part` says what it stands for: a link, the housing of a joint, the tool.
    """

    kind: Literal["capsule", "cylinder", "sphere"]
    start: Array
    end: Array
    radius: float
    part: Literal["link", "joint", "tool"]


def solids(chain: SerialChain) -> tuple[tuple[Solid, ...], ...]:
    """Return the solids of the n + 1 bodies, first those of the base, then of links 1 .. n.

    A link runs from the origin of its joint to that of the next, the last one to the tip; it leaves along
    its own axis and arrives along the next where that bends it, and is left out where the two origins
    coincide. The housing of a joint stands at its origin in the body before it; a prismatic joint has a rail
    there, over its travel, and a carriage in the body that it moves. Bodies in a row touch at any q: a travel
    without end is drawn to the length of the arm, and beyond its rail a carriage floats.
    """
    length, radii = _size(chain)
    bodies = []
    for i, radius in enumerate(radii):
        own = chain.joints[i - 1] if i else None
        following = chain.joints[i] if i < chain.n else None
        out: list[Solid] = []
        if own is not None and own.kind == "prismatic":
            out.append(_around(np.zeros(3), own.axis, radius, radius, "link"))
        if following is None:
            out += _last(chain.tip_xyz, own, radius)
        else:
            axis = rotation_of(following.rpy) @ following.axis
            corners = _corners(following.xyz, own, axis, radius)
            if own is None and (rise := float(np.linalg.norm(corners[1 % len(corners)]))) > 1.5 * radius:
                upright = corners[1] / rise
                out.append(Solid("cylinder", np.zeros(3), 0.3 * radius * upright, 1.6 * radius, "link"))
                out.append(Solid("cylinder", np.zeros(3), radius * upright, radius, "link"))
                corners[0] = radius * upright  # a half sphere would reach below the floor
            out += _capsules(corners, radius)
            if following.kind == "prismatic":
                low, high = _travel(following, length)
                start, end = (following.xyz + s * axis for s in (low - radius, high + radius))
                out.append(Solid("cylinder", start, end, 0.5 * radius, "joint"))
            else:
                half = (0.5 if _is_collar(corners, axis) else 1.3) * radius
                out.append(_around(following.xyz, axis, half, 1.15 * radius, "joint"))
        bodies.append(tuple(out))
    return tuple(bodies)


def with_solids(chain: SerialChain) -> str:
    """Return the chain's canonical URDF with its solids as visuals; a capsule is a cylinder and two spheres."""
    root = ET.fromstring(chain.to_urdf(own_names=True))
    links = {link.get("name"): link for link in root.iter("link")}
    for i, body in enumerate(solids(chain)):
        link = links[f"link_{i}" if i else "base"]
        for solid in body:
            along = solid.end - solid.start
            if solid.kind != "sphere":
                yaw, pitch = np.arctan2(along[1], along[0]), np.arctan2(np.hypot(*along[:2]), along[2])
                size = {"radius": solid.radius, "length": float(np.linalg.norm(along))}
                middle = (solid.start + solid.end) / 2
                _add_visual(link, "cylinder", middle, np.array([0.0, pitch, yaw]), size, solid.part)
            if solid.kind != "cylinder":
                ends = [solid.start] if solid.kind == "sphere" else [solid.start, solid.end]
                for end in ends:
                    _add_visual(link, "sphere", end, np.zeros(3), {"radius": solid.radius}, solid.part)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _size(chain: SerialChain) -> tuple[float, Array]:
    """Return the length of the arm [m] and the radius of each body [m], which tapers towards the wrist."""
    lengths = [float(np.linalg.norm(xyz)) for xyz in (*(j.xyz for j in chain.joints), chain.tip_xyz)]
    lengths += [j.upper - j.lower for j in chain.joints if j.kind == "prismatic"]
    lengths = [x for x in lengths if np.isfinite(x) and x > 0]
    lengths = [x for x in lengths if x > 1e-6 * max(lengths)] or [LENGTHLESS]
    radius = min(SLIM * sum(lengths), STOUT * float(np.median(lengths)))
    return sum(lengths), radius * np.linspace(1, WRIST, chain.n + 1)


def _travel(joint: Joint, length: float) -> tuple[float, float]:
    """Return the ends of a rail, which holds the origin of the joint too."""
    low = joint.lower if np.isfinite(joint.lower) else -length / 2
    high = joint.upper if np.isfinite(joint.upper) else length / 2
    return min(low, 0.0), max(high, 0.0)


def _around(
    centre: Array, axis: Array, half: float, radius: float, part: Literal["link", "joint", "tool"]
) -> Solid:
    """Return a cylinder about an axis, `half` to either side of its centre."""
    return Solid("cylinder", centre - half * axis, centre + half * axis, radius, part)


def _corners(to: Array, own: Joint | None, axis: Array | None, radius: float) -> list[Array]:
    """Return the corners of a link from the origin to `to`; only the origin where both coincide.

    Along the one axis, across, and along the other one: at most √3 times as long as straight.
    """
    if np.linalg.norm(to) <= 0.4 * radius:  # the housing at `to` then holds the origin too
        return [np.zeros(3)]
    first = own.axis * (own.axis @ to) if own is not None else np.zeros(3)
    second = to - axis * (axis @ (to - first)) if axis is not None else to
    path = [np.zeros(3)]
    for corner in (first, second):
        if min(np.linalg.norm(corner - path[-1]), np.linalg.norm(corner - to)) > 0.5 * radius:
            path.append(corner)
    path.append(to)
    return path


def _is_collar(corners: list[Array], axis: Array) -> bool:
    """Return whether a link arrives along the axis of its joint, whose housing then is a collar around it."""
    if len(corners) == 1:
        return False
    along = corners[-1] - corners[-2]
    return bool(abs(axis @ along) > 0.9 * np.linalg.norm(along))


def _capsules(corners: list[Array], radius: float) -> list[Solid]:
    """Return a link along its corners."""
    return [Solid("capsule", a, b, radius, "link") for a, b in pairwise(corners)]


def _last(tip: Array, own: Joint | None, radius: float) -> list[Solid]:
    """Return the last link, and a flange that ends at the tip; a ball for a tip without length."""
    corners = _corners(tip, own, None, radius)
    if len(corners) == 1:
        return [Solid("sphere", tip, tip, 1.5 * radius, "tool")]  # larger than the housing around it
    along = corners[-1] - corners[-2]
    length = float(np.linalg.norm(along))
    flange = min(1.6 * radius, length)
    neck = tip - along * flange / length
    corners[-1] = neck - along * min(radius, length - flange) / length
    if np.linalg.norm(corners[-1] - corners[-2]) < 1e-3 * radius:
        corners.pop()
    return [*_capsules(corners, radius), Solid("cylinder", corners[-1], tip, 0.8 * radius, "tool")]


def _add_visual(
    link: ET.Element, shape: str, xyz: Array, rpy: Array, size: dict[str, float], part: str
) -> None:
    """Give a link one more visual."""
    visual = ET.SubElement(link, "visual")
    words = {"xyz": xyz, "rpy": rpy}
    ET.SubElement(
        visual, "origin", {key: " ".join(repr(float(v)) for v in value) for key, value in words.items()}
    )
    geometry = ET.SubElement(visual, "geometry")
    ET.SubElement(geometry, shape, {key: repr(float(value)) for key, value in size.items()})
    material = ET.SubElement(visual, "material", {"name": f"passiflex_{part}"})
    ET.SubElement(material, "color", {"rgba": COLOURS[part]})
