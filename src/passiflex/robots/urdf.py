"""Reading a URDF document: one tree of links and joints, every number checked."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from passiflex.errors import RobotError, nearest
from passiflex.robots.bodies import ROUND_OFF, Array, Body, Pose, rotation_of, turned

UNLIMITED = 1e9
"""A limit of this size or more in a URDF document means no limit."""

COMPONENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
LIMITS = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf, "effort": np.inf}


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
    """One joint of the document, moving or fixed, with the links it connects."""

    joint: Joint
    parent: str
    child: str
    fixed: bool


class Document(NamedTuple):
    """One tree: the link without a parent, the joints that leave each link, the links' inertias if any."""

    name: str
    base: str
    children: dict[str, list[Edge]]
    inertials: dict[str, Body]


def read_document(text_or_path: str | Path) -> Document:
    """Return the tree of a URDF document, given as text (any string with a `<`) or as a path."""
    root = _parse(text_or_path)
    links = _by_name(root.findall("link"), "link")
    edges = [_read_joint(e, name) for name, e in _by_name(root.findall("joint"), "joint").items()]
    inertials = {name: body for name, e in links.items() if (body := _read_inertial(e, name)) is not None}
    base, children = _tree(edges, list(links))
    return Document(root.get("name") or "arm", base, children, inertials)


def _parse(text_or_path: str | Path) -> ET.Element:
    """Return the root of a document that is safe to read."""
    if isinstance(text_or_path, str) and "<" in text_or_path:
        source, text = "the URDF text", text_or_path
    else:
        source = str(text_or_path)
        try:
            text = Path(text_or_path).read_text(encoding="utf-8-sig")
        except (OSError, ValueError) as e:
            raise RobotError(f"the URDF file {source!r} cannot be read", got=e, needs="a text file") from e
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise RobotError(f"{source} has a DOCTYPE or entities", needs="plain XML", try_="removing them")
    if re.search(r"</?xacro:|\$[{(]", re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)):
        try_ = "expanding it first: xacro FILE > arm.urdf"
        raise RobotError(f"{source} is a xacro template", needs="plain URDF", try_=try_)
    try:
        root = ET.fromstring(text)
    except ET.ParseError as e:
        raise RobotError(f"{source} is not well-formed XML, line {e.position[0]}", got=e, needs="URDF") from e
    if root.tag != "robot":
        raise RobotError(f"{source} is not a URDF document", got=f"root <{root.tag}>", needs="root <robot>")
    if root.find("joint") is None:
        raise RobotError(f"{source} has no joints", needs="links and the joints between them")
    return root


def _attribute(element: ET.Element | None, attribute: str, where: str, tag: str) -> str:
    """Return a required attribute of an element of `where`."""
    value = None if element is None else element.get(attribute)
    if not value:
        raise RobotError(f"{where} lacks <{tag} {attribute}=...>", needs="this attribute, not empty")
    return value


def _numbers(text: str, size: int, where: str, *, infinite: bool = False) -> Array:
    """Return the `size` numbers of an attribute."""
    try:
        value = np.array([float(word) for word in text.replace("_", "?").split()])
    except ValueError:
        value = np.array([np.nan])
    if value.size != size or np.isnan(value).any() or (np.isinf(value).any() and not infinite):
        needs = f"{size} {'' if infinite else 'finite '}number{'s' * (size > 1)}"
        raise RobotError(f"{where} is wrong", got=repr(text), needs=needs)
    return value


def _by_name(elements: list[ET.Element], tag: str) -> dict[str, ET.Element]:
    """Return the elements by their names, which differ."""
    out: dict[str, ET.Element] = {}
    for e in elements:
        name = _attribute(e, "name", f"a {tag}", tag)
        if name in out:
            raise RobotError(f"two {tag}s have the same name", got=repr(name), needs="different names")
        out[name] = e
    return out


def _read_origin(element: ET.Element, where: str) -> tuple[Array, Array]:
    """Return xyz and rpy of an element's <origin>, zero where absent."""
    origin = element.find("origin")
    xyz = _vector(origin, "xyz", f"{where}: <origin xyz=...>", default="0 0 0")
    rpy = _vector(origin, "rpy", f"{where}: <origin rpy=...>", default="0 0 0")
    return xyz, rpy


def _vector(element: ET.Element | None, attribute: str, where: str, *, default: str) -> Array:
    """Return the three numbers of an attribute that may be absent."""
    return _numbers(default if element is None else element.get(attribute, default), 3, where)


def _read_joint(element: ET.Element, name: str) -> Edge:
    """Return one joint of the document."""
    where = f"joint {name!r}"
    kind = _attribute(element, "type", where, "joint")
    if kind not in ("revolute", "continuous", "prismatic", "fixed"):
        needs = "revolute, continuous, prismatic or fixed"
        raise RobotError(f"{where} is of a kind that cannot be used", got=repr(kind), needs=needs)
    if element.find("mimic") is not None:
        raise RobotError(f"{where} mimics another joint", needs="independent joints", try_="making it fixed")
    parent, child = (_attribute(element.find(tag), "link", where, tag) for tag in ("parent", "child"))
    xyz, rpy = _read_origin(element, where)
    axis = _vector(element.find("axis"), "xyz", f"{where}: <axis xyz=...>", default="1 0 0")
    length = float(np.linalg.norm(axis))
    if length < ROUND_OFF and kind != "fixed":
        raise RobotError(f"{where} has a zero axis", got=axis.tolist(), needs="a direction")
    limit, limits = element.find("limit"), dict(LIMITS)
    for key in LIMITS:
        if limit is not None and (text := limit.get(key)) is not None:
            value = float(_numbers(text, 1, f"{where}: <limit {key}=...>", infinite=True)[0])
            limits[key] = value if abs(value) < UNLIMITED else float(np.copysign(np.inf, value))
    if kind == "continuous":
        limits["lower"], limits["upper"] = -np.inf, np.inf
    possible = limits["lower"] < limits["upper"] and limits["velocity"] >= 0 and limits["effort"] >= 0
    if kind != "fixed" and not possible:
        got = ", ".join(f"{key} {value:g}" for key, value in limits.items())
        needs = "lower < upper, velocity >= 0, effort >= 0"
        raise RobotError(f"{where} has impossible limits", got=got, needs=needs)
    moves: Literal["revolute", "prismatic"] = "prismatic" if kind == "prismatic" else "revolute"
    joint = Joint(name, moves, xyz, rpy, axis if kind == "fixed" else axis / length, **limits)
    return Edge(joint, parent, child, kind == "fixed")


def _read_inertial(element: ET.Element, name: str) -> Body | None:
    """Return the inertia of one link of the document in link axes, None where it has none."""
    inertial, where = element.find("inertial"), f"link {name!r}"
    if inertial is None:
        return None
    xyz, rpy = _read_origin(inertial, where)
    text = _attribute(inertial.find("mass"), "value", where, "mass")
    mass = _numbers(text, 1, f"{where}: <mass value=...>")[0]
    tensor = inertial.find("inertia")
    texts = {key: _attribute(tensor, key, where, "inertia") for key in COMPONENTS}
    inertia = np.array([_numbers(text, 1, f"{where}: <inertia {key}=...>")[0] for key, text in texts.items()])
    return turned(Body(float(mass), np.zeros(3), inertia), Pose(xyz, rotation_of(rpy)))


def _tree(edges: list[Edge], links: list[str]) -> tuple[str, dict[str, list[Edge]]]:
    """Return the base of a document that is one tree, and the joints that leave each link."""
    children: dict[str, list[Edge]] = {link: [] for link in links}
    parents: dict[str, str] = {}
    for edge in edges:
        for end in (edge.parent, edge.child):
            if end not in links:
                needs, try_ = f"one of {', '.join(links)}", " or ".join(repr(n) for n in nearest(end, links))
                what = f"joint {edge.joint.name!r} refers to an unknown link"
                raise RobotError(what, got=repr(end), needs=needs, try_=try_)
        if edge.child in parents:
            got = f"joints {parents[edge.child]!r} and {edge.joint.name!r}"
            raise RobotError(f"closed loop: link {edge.child!r} has two parents", got=got, needs="a tree")
        parents[edge.child] = edge.joint.name
        children[edge.parent].append(edge)
    roots = [link for link in links if link not in parents]
    if len(roots) > 1:
        got, try_ = ", ".join(repr(r) for r in roots), "joining them by fixed joints"
        raise RobotError("more than one link has no parent", got=got, needs="one base", try_=try_)
    reached = list(roots)
    for link in reached:
        reached += [e.child for e in children[link]]
    if loop := [link for link in links if link not in reached]:
        got = ", ".join(repr(link) for link in loop)
        raise RobotError("closed loop: these links do not hang on a base", got=got, needs="a tree")
    return roots[0], children
