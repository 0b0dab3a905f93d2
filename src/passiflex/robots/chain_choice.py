"""Which chain of a tree of links is the arm: from base to end effector, by name or by what the tree shows."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from passiflex.errors import NameUnknownError, RobotError
from passiflex.robots.bodies import HERE, Placement, rotation_of
from passiflex.robots.urdf import Document
from passiflex.robots.urdf_parts import Edge, Joint, listed

LEAST_TRUNK = 4
"""Joints that chains of equal length must have in common, and half of theirs, to be one arm with fingers."""
LEAST_ARM = 3
"""Joints that are left of an arm whose last ones are taken for a gripper's."""
GRIPS = re.compile("finger|grip|jaw|claw|knuckle|thumb|(^|_)(index|middle|ring|little|pinky)", re.IGNORECASE)
"""How the joints of a gripper are called."""
TIPS = (
    r"tcp|tool_?center",
    r"tool0|tool",
    r"(^|_)ee(f|$|_)|end_?effector",
    r"flange|mount",
    r"grasp|tip",
    r"hand|gripper",
)
"""How links are called that are an end effector: the first that is there counts."""


class Choice(NamedTuple):
    """A chain of a document: where it begins and ends, the joints on the way, and what is to be said of it."""

    base: str
    tip: str
    path: tuple[Edge, ...]
    remarks: tuple[str, ...]

    @property
    def moving(self) -> tuple[Edge, ...]:
        """Return the joints that move it."""
        return tuple(edge for edge in self.path if not edge.fixed)


class Tree:
    """The joints of a document, from the base up and from every link down."""

    def __init__(self, document: Document):
        self.root, self.children = document.base, document.children
        edges = [edge for leaving in document.children.values() for edge in leaving]
        self.above = {edge.child: edge for edge in edges}
        self.led = {edge.mimics for edge in edges if edge.mimics}

    def path(self, link: str, base: str | None = None) -> list[Edge]:
        """Return the joints from a base, the root unless given, to a link."""
        out: list[Edge] = []
        while link != (base or self.root):
            if link not in self.above:
                raise RobotError(
                    f"the base {base!r} does not carry the end effector", needs="a link on its way"
                )
            out.append(self.above[link])
            link = self.above[link].parent
        return out[::-1]

    def fixed_to(self, link: str) -> Iterator[str]:
        """Yield a link and all that are fixed to it."""
        queue = [link]
        for parent in queue:
            yield parent
            queue += [e.child for e in self.children[parent] if e.fixed]

    @property
    def ends(self) -> list[list[Edge]]:
        """Return the paths to the last joints of all branches that are driven, each from behind what floats."""
        out = []
        for link, edge in self.above.items():
            beyond = (e for below in self.fixed_to(link) for e in self.children[below])
            if not (edge.fixed or edge.passive) and all(e.fixed or e.passive for e in beyond):
                driven = self.path(link)
                free = [i for i, e in enumerate(driven) if e.passive and not e.mimics]
                driven = driven[free[-1] + 1 :] if free else driven
                out.append(self.without_gripper(driven))
        return out

    def without_gripper(self, path: list[Edge]) -> list[Edge]:
        """Return a path without joints at its end that are a gripper's: called so, or leading others."""
        moving = [e for e in path if not e.fixed]
        while len(moving) > LEAST_ARM:
            last = moving[-1]
            if not (GRIPS.search(last.joint.name) or last.joint.name in self.led):
                break
            moving.pop()
            path = path[: path.index(last)]
        return path


def choose(document: Document, base: str | None = None, end_effector: str | None = None) -> Choice:
    """Return the chain that is asked for; without names the longest one.

    Raises
    ------
    NameUnknownError
        For a link that is not there.
    RobotError
        If the base does not carry the end effector, a joint on the way cannot be driven, nothing moves, or several
        chains are the longest.
    """
    for what, name in (("base", base), ("end effector", end_effector)):
        if name is not None and name not in document.children:
            raise NameUnknownError(what, name, document.children)
    tree = Tree(document)
    told = end_effector is not None
    if end_effector is None:
        path = _longest(tree, base)
        last = path[-1].child if path else base or tree.root
        end_effector = _tip(tree, last)
        path += tree.path(end_effector, last)
    else:
        path = tree.path(end_effector, base)
        if base is None:
            free = [i for i, e in enumerate(path) if e.passive and not e.mimics]
            path = path[free[-1] + 1 :] if free else path
    start = path[0].parent if path else base or tree.root
    for edge in path:
        if edge.passive:
            raise RobotError(
                f"joint {edge.joint.name!r} {edge.passive}",
                needs="joints that are driven, one by one, from base to end effector",
                try_="an end effector before it, or a base behind it",
            )
    if not any(not edge.fixed for edge in path):
        raise RobotError("the robot has no moving joint", needs="revolute, continuous or prismatic ones")
    moving = [e for e in tree.above.values() if not e.fixed]
    beside = [link for link in tree.fixed_to(end_effector) if link != end_effector]
    count = sum(not e.fixed for e in path)
    chosen = not told and (beside or len(moving) > count)
    said = []
    if chosen or (base is None and start != tree.root):
        said.append(f"the arm goes from {start!r} to {end_effector!r}: {count} joint{'s' * (count > 1)}")
    return Choice(start, end_effector, tuple(path), tuple(said))


def _longest(tree: Tree, base: str | None) -> list[Edge]:
    """Return the path with the most joints; the trunk of several that differ in their last joints only."""
    ends = tree.ends
    if base is not None:
        below = set(_below(tree, base))
        ends = [
            tree.without_gripper(tree.path(p[-1].child, base)) for p in ends if p and p[-1].child in below
        ]
    counted = [(sum(not e.fixed for e in path), path) for path in ends]
    most = max((count for count, _ in counted), default=0)
    found = _distinct([_to_last_joint(path) for count, path in counted if count == most and most])
    if len(found) > 1:
        trunk = _common(found)
        if sum(not e.fixed for e in trunk) < max(LEAST_TRUNK, most / 2):
            raise RobotError(
                f"several chains of the robot are the longest, with {most} joints",
                got=listed(f"one to {path[-1].child!r}" for path in found),
                needs="the name of the end effector",
                try_=listed(_tip(tree, path[-1].child) for path in found),
            )
        return _to_last_joint(trunk)
    return found[0] if found else []


def _below(tree: Tree, link: str) -> Iterator[str]:
    queue = [link]
    for parent in queue:
        yield parent
        queue += [e.child for e in tree.children[parent]]


def _distinct(paths: list[list[Edge]]) -> list[list[Edge]]:
    return list({path[-1].child: path for path in paths if path}.values())


def _to_last_joint(path: list[Edge]) -> list[Edge]:
    """Return a path up to its last moving joint."""
    moving = [i for i, e in enumerate(path) if not e.fixed]
    return path[: moving[-1] + 1] if moving else []


def _common(paths: list[list[Edge]]) -> list[Edge]:
    """Return the joints that all paths begin with."""
    out = []
    for edges in zip(*paths, strict=False):
        if any(e is not edges[0] for e in edges):
            break
        out.append(edges[0])
    return out


def _tip(tree: Tree, last: str) -> str:
    """Return the end effector of what moves with a link: the only link at its end, or the one that is called so."""
    there = list(tree.fixed_to(last))
    if len(ends := [link for link in there if not any(e.fixed for e in tree.children[link])]) == 1:
        return ends[0]
    for called in TIPS:
        if found := [link for link in there if re.search(called, link, re.IGNORECASE)]:
            return found[-1]
    return last


def frozen_at(edge: Edge, values: Mapping[str, float]) -> float:
    """Return where a joint stands that is not of the chain: as told, else at 0, or amid a range without 0."""
    joint = edge.joint
    if joint.name in values:
        return float(values[joint.name])
    if edge.passive and not edge.mimics:
        return 0.0
    if joint.lower <= 0 <= joint.upper:
        return 0.0
    ends = [limit for limit in (joint.lower, joint.upper) if np.isfinite(limit)]
    return float(np.mean(ends))


def held_still(edges: Sequence[Edge], values: Mapping[str, float]) -> dict[str, float]:
    """Return where joints stand that are not of the chain: those that follow another one where that puts them."""
    held = {edge.joint.name: frozen_at(edge, values) for edge in edges}
    for edge in edges:
        if edge.mimics in held and edge.joint.name not in values:
            times, more = edge.follows
            held[edge.joint.name] = times * held[edge.mimics] + more
    return held


def moved(joint: Joint, value: float) -> Placement:
    """Return the frame of a joint that stands at a value, in the link that carries it."""
    R = rotation_of(joint.rpy)
    if not value:
        return Placement(joint.xyz, R)
    if joint.kind == "prismatic":
        return Placement(joint.xyz + R @ (value * joint.axis), R)
    return Placement(joint.xyz, R @ Rotation.from_rotvec(value * joint.axis).as_matrix())


def placed(path: Sequence[Edge], values: Mapping[str, float]) -> Placement:
    """Return the last frame of a path in its first, all joints frozen."""
    at = HERE
    for edge in path:
        step = moved(edge.joint, 0.0 if edge.fixed else frozen_at(edge, values))
        at = Placement(at.xyz + at.rotation @ step.xyz, at.rotation @ step.rotation)
    return at
