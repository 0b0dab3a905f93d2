"""The parts of a URDF document: joints and inertias, every number checked."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from passiflex.errors import RobotError
from passiflex.robots.bodies import ROUND_OFF, Array, Body, Placement, rotation_of, rpy_of, turned
from passiflex.robots.urdf_words import refuse_unread
from passiflex.robots.urdf_xml import ATTRIBUTES
from passiflex.texts.quantity import shown

UNLIMITED = 1e9
"""A limit of this size or more in a URDF document means no limit."""
LARGEST = 1e9
"""A length, angle, mass or moment of inertia beyond this is no robot's, in whichever unit."""
FULL_TURN = 6.3
"""An angle [rad] beyond this is likely meant in degrees."""
MOST_TURNS = 8 * np.pi
"""A limit [rad] beyond this likewise: few cables bear more turns, and who has none writes continuous."""
MOST_NAMES = 20
LONGEST = 1000  # characters of one attribute with numbers

WITHOUT_QUATERNIONS = ("1", "1.0")
COMPONENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
FREE = ("floating", "planar")
"""Kinds that only something outside of the robot moves."""
MOVES = ("origin", "axis", "limit", "mimic")
"""What is read of a joint that moves."""
LIMITS = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf, "effort": np.inf}
FIRST = np.array([1.0, 0.0, 0.0])
FIRST.setflags(write=False)
_NUMBER = re.compile(r"[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|(?i:inf|infinity))")


class Joint(NamedTuple):
    """One joint: origin in the parent's frame, unit axis, limits in SI units, infinite where there are none.

    `rpy` are roll, pitch and yaw about fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll).
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    xyz: Array
    rpy: Array
    axis: Array
    lower: float
    upper: float
    velocity: float
    effort: float


class Edge(NamedTuple):
    """One joint of the document, moving or fixed, with the links it connects.

    `passive` says why it cannot be moved by a motor of its own, `mimics` the joint that it follows, `follows` by which
    multiplier and offset, `wrong` what of it cannot be read, which matters only if it is to move.
    """

    joint: Joint
    parent: str
    child: str
    fixed: bool
    passive: str = ""
    mimics: str = ""
    follows: tuple[float, float] = (1.0, 0.0)
    wrong: RobotError | None = None


def attribute(element: ET.Element | None, attribute: str, where: str, tag: str) -> str:
    """Return a required attribute of an element of `where`."""
    value = None if element is None else element.get(attribute)
    if not value:
        others = [] if element is None else [name for name in element.attrib if name not in ATTRIBUTES[tag]]
        got = ", ".join(others) or (shown(element.text) if element is not None and element.text else None)
        raise RobotError(f"{where} lacks <{tag} {attribute}=...>", got=got, needs="this attribute, not empty")
    return value


def _numbers(text: str, size: int, where: str, *, infinite: bool = False, most: float = np.inf) -> Array:
    """Return the `size` numbers of an attribute, none of them larger than `most`."""
    words = text.split() if len(text) <= LONGEST else []
    value = np.array([float(word) if _NUMBER.fullmatch(word) else np.nan for word in words])
    if value.size != size or np.isnan(value).any() or (np.isinf(value).any() and not infinite):
        needs = f"{size} {'' if infinite else 'finite '}number{'s' * (size > 1)}"
        raise RobotError(f"{where} is wrong", got=shown(text), needs=needs)
    if np.abs(value).max() > most and not infinite:
        raise RobotError(f"{where} is too large", got=shown(text), needs=f"at most {most:g}")
    return value


class PartReader:
    """Joints and inertias of a document, and what strikes one when reading them."""

    def __init__(self, version: str):
        self.version = version
        self.degrees: list[str] = []
        self.turned_far: list[str] = []
        self.damped: list[str] = []
        self.doubled: list[str] = []

    def remarks(self) -> Iterator[str]:
        """Yield a sentence on each thing that a document can hardly mean, or that is not read of it."""
        if self.turned_far:
            yield f"{listed(self.turned_far)}: <limit> looks like degrees, and is read as rad"
        if self.degrees:
            yield f"{listed(self.degrees)}: rpy looks like degrees, and is read as rad"
        if self.damped:
            yield (
                f"{listed(self.damped)}: <dynamics> is ignored; joint_damping of the robot file and friction of a "
                "scenario's motors stand for it"
            )
        if self.doubled:
            yield f"{listed(self.doubled)}: the first one counts, as for other readers of URDF"

    def joint(self, element: ET.Element, name: str) -> Edge:
        """Return one joint of the document."""
        where = f"joint {name!r}"
        kind = attribute(element, "type", where, "joint")
        if kind not in KINDS:
            raise RobotError(
                f"{where} is of a kind that URDF does not know", got=repr(kind), needs=listed(KINDS)
            )
        fixed = kind == "fixed"
        refuse_unread(element, where, [] if element.find("origin") is not None else ["origin"])
        parent, child = (
            attribute(self._first(element, tag, where), "link", where, tag) for tag in ("parent", "child")
        )
        xyz, rpy = self._origin(element, where)
        moves: Literal["revolute", "prismatic"] = "prismatic" if kind == "prismatic" else "revolute"
        if fixed or kind in FREE:
            passive = "" if fixed else f"is {kind}: nothing drives it"
            return Edge(Joint(name, moves, xyz, rpy, FIRST, **LIMITS), parent, child, fixed, passive)
        leader = element.find("mimic")
        mimics = "" if leader is None else attribute(leader, "joint", where, "mimic")
        passive = f"mimics joint {mimics!r}" if mimics else ""
        axis, limits, follows, wrong = FIRST, dict(LIMITS), (1.0, 0.0), None
        try:
            if leader is not None:
                says = zip(("multiplier", "offset"), ("1", "0"), strict=True)
                times, more = (
                    float(_numbers(leader.get(n, other), 1, f"{where}: {n}")[0]) for n, other in says
                )
                follows = times, more
            refuse_unread(element, where, [tag for tag in MOVES if element.find(tag) is None])
            axis = self._axis(element, where)
            limits = self._limits(element, where, continuous=kind == "continuous")
        except RobotError as error:
            wrong = error
        return Edge(
            Joint(name, moves, xyz, rpy, axis, **limits),
            parent,
            child,
            fixed,
            passive,
            mimics,
            follows,
            wrong,
        )

    def moving(self, element: ET.Element, joint: Joint) -> None:
        """Note what strikes one at a joint that moves."""
        where = f"joint {joint.name!r}"
        dynamics = element.find("dynamics")
        if dynamics is not None and any(not _zero(value) for value in dynamics.attrib.values()):
            self.damped.append(where)
        farthest = max(abs(joint.lower), abs(joint.upper))
        if element.get("type") == "revolute" and MOST_TURNS < farthest < np.inf:
            self.turned_far.append(where)

    def inertial(self, element: ET.Element, name: str) -> Body | None:
        """Return the inertia of one link of the document in link axes, None where it has none."""
        where = f"link {name!r}"
        inertial = self._first(element, "inertial", where)
        if inertial is None:
            refuse_unread(element, where, ["inertial"])
            return None
        refuse_unread(inertial, where, [] if inertial.find("origin") is not None else ["origin"])
        xyz, rpy = self._origin(inertial, where)
        text = attribute(self._first(inertial, "mass", where), "value", where, "mass")
        mass = _numbers(text, 1, f"{where}: <mass value=...>", most=LARGEST)[0]
        tensor = self._first(inertial, "inertia", where)
        texts = {key: attribute(tensor, key, where, "inertia") for key in COMPONENTS}
        moments = [
            _numbers(text, 1, f"{where}: <inertia {key}=...>", most=LARGEST)[0] for key, text in texts.items()
        ]
        body = Body(float(mass), np.zeros(3), np.array(moments))
        return turned(body, Placement(xyz, rotation_of(rpy)))

    def _first(self, element: ET.Element, tag: str, where: str) -> ET.Element | None:
        """Return the first element of a kind in another, None where there is none."""
        found = element.findall(tag)
        if len(found) > 1:
            self.doubled.append(f"{where} has {len(found)} <{tag}>")
        return found[0] if found else None

    def _origin(self, element: ET.Element, where: str) -> tuple[Array, Array]:
        """Return xyz and rpy of an element's <origin>, zero where absent."""
        origin = self._first(element, "origin", where)
        if origin is None:
            return np.zeros(3), np.zeros(3)
        absent = [] if "xyz" in origin.attrib else ["xyz"]
        absent += [] if {"rpy", "quat_xyzw"} & set(origin.attrib) else ["rpy", "quat_xyzw"]
        refuse_unread(origin, where, absent)
        xyz = _numbers(origin.get("xyz", "0 0 0"), 3, f"{where}: <origin xyz=...>", most=LARGEST)
        if (quaternion := origin.get("quat_xyzw")) is not None:
            return xyz, self._rpy_of(quaternion, origin, where)
        rpy = _numbers(origin.get("rpy", "0 0 0"), 3, f"{where}: <origin rpy=...>", most=LARGEST)
        if np.abs(rpy).max() > FULL_TURN:
            self.degrees.append(where)
        return xyz, rpy

    def _rpy_of(self, quaternion: str, origin: ET.Element, where: str) -> Array:
        """Return roll, pitch and yaw of a quaternion, which URDF knows since 1.1; its length does not count."""
        here = f"{where}: <origin quat_xyzw=...>"
        if origin.get("rpy") is not None:
            raise RobotError(f"{here} stands beside rpy", needs="one of them")
        if self.version in WITHOUT_QUATERNIONS:
            try_ = '<robot version="1.1" ...>, or rpy'
            raise RobotError(f"{here} came with URDF 1.1", got=f"version {self.version}", needs=try_)
        q = _numbers(quaternion, 4, here)
        if not np.abs(q).max() > 0:
            raise RobotError(f"{here} is zero", needs="a rotation, as 0 0 0 1")
        return rpy_of(Rotation.from_quat(q / np.abs(q).max()).as_matrix())

    def _axis(self, element: ET.Element, where: str) -> Array:
        """Return the unit axis of a joint, x where there is none."""
        axis = self._first(element, "axis", where)
        if axis is None:
            return FIRST
        refuse_unread(axis, where, [] if "xyz" in axis.attrib else ["xyz"])
        vector = _numbers(attribute(axis, "xyz", where, "axis"), 3, f"{where}: <axis xyz=...>")
        largest = np.abs(vector).max()
        if largest < ROUND_OFF:
            raise RobotError(f"{where} has a zero axis", got=vector.tolist(), needs="a direction")
        vector = vector / largest  # whose squares neither overflow nor vanish
        return vector / np.linalg.norm(vector)

    def _limits(self, element: ET.Element, where: str, *, continuous: bool) -> dict[str, float]:
        """Return the limits of a joint, infinite where there are none."""
        limit, limits = self._first(element, "limit", where), dict(LIMITS)
        if limit is None:
            return limits
        used = [key for key in LIMITS if not (continuous and key in ("lower", "upper"))]
        refuse_unread(limit, where, [key for key in used if key not in limit.attrib])
        for key in used:
            if (text := limit.get(key)) is not None:
                value = float(_numbers(text, 1, f"{where}: <limit {key}=...>", infinite=True)[0])
                limits[key] = value if abs(value) < UNLIMITED else float(np.copysign(np.inf, value))
        if not (limits["lower"] < limits["upper"] and limits["velocity"] >= 0 and limits["effort"] >= 0):
            got = ", ".join(f"{key} {value:g}" for key, value in limits.items())
            needs = "lower < upper, velocity >= 0, effort >= 0"
            raise RobotError(f"{where} has impossible limits", got=got, needs=needs)
        return limits


def _zero(text: str) -> bool:
    try:
        return float(text) == 0
    except ValueError:
        return False


def listed(names: Iterable[str]) -> str:
    """Return names in one line; of very many the first ones."""
    first = list(names)
    more = len(first) - MOST_NAMES
    return ", ".join(first[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
