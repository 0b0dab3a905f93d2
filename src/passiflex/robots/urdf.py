"""Reading a URDF document: one tree of links and joints."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from passiflex.errors import RobotError, nearest
from passiflex.robots.bodies import Body
from passiflex.robots.urdf_parts import Edge, PartReader, attribute, listed
from passiflex.robots.urdf_words import refuse_misspelt
from passiflex.robots.urdf_xml import read_xml

VERSIONS = ("1", "1.0", "1.1", "1.2")


@dataclass(frozen=True, eq=False)
class Document:
    """One tree: the link without a parent, and the joints that leave each link; of other parts what is asked for."""

    name: str
    base: str
    children: dict[str, list[Edge]]
    links: dict[str, ET.Element]
    joints: dict[str, ET.Element]
    reader: PartReader

    def inertial(self, link: str) -> Body | None:
        """Return the inertia of a link, if it has any."""
        return self.reader.inertial(self.links[link], link)

    def moving(self, edges: Iterable[Edge]) -> None:
        """Say of joints that they are to move.

        Raises
        ------
        RobotError
            If something of one cannot be read.
        """
        for edge in edges:
            if edge.wrong is not None:
                raise edge.wrong
            self.reader.moving(self.joints[edge.joint.name], edge.joint)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Return sentences on what of all that was asked for can hardly be meant, or is not read."""
        return tuple(self.reader.remarks())


def read_document(source: str | Path) -> Document:
    """Return the tree of a URDF document, given as text (any string with a `<`) or as a path.

    Raises
    ------
    RobotError
        If it cannot be read, is no tree, or something in it that would be read is misspelt or no number.
    """
    name, root = read_xml(source)
    refuse_misspelt(root, name)
    if root.find("joint") is None:
        raise RobotError(f"{name} has no joints", needs="links and the joints between them")
    reader = PartReader(_version(root, name))
    links = _by_name(root.findall("link"), "link")
    joints = _by_name(root.findall("joint"), "joint")
    base, children = _tree([reader.joint(e, name) for name, e in joints.items()], list(links))
    return Document(root.get("name") or "arm", base, children, links, joints, reader)


def _version(root: ET.Element, name: str) -> str:
    """Return the version of URDF that a document is written in."""
    version = root.get("version", "1.0").strip()
    if version not in VERSIONS:
        needs = f"{', '.join(VERSIONS[1:-1])} or {VERSIONS[-1]}"
        raise RobotError(f"{name} is of an unknown version of URDF", got=repr(version), needs=needs)
    return version


def _by_name(elements: list[ET.Element], tag: str) -> dict[str, ET.Element]:
    """Return the elements by their names, which differ."""
    out: dict[str, ET.Element] = {}
    for e in elements:
        name = attribute(e, "name", f"a {tag}", tag)
        if name in out:
            raise RobotError(f"two {tag}s have the same name", got=repr(name), needs="different names")
        out[name] = e
    return out


def _tree(edges: list[Edge], links: list[str]) -> tuple[str, dict[str, list[Edge]]]:
    """Return the base of a document that is one tree, and the joints that leave each link."""
    children: dict[str, list[Edge]] = {link: [] for link in links}
    parents: dict[str, str] = {}
    for edge in edges:
        for end in (edge.parent, edge.child):
            if end not in children:
                needs, try_ = f"one of {listed(links)}", " or ".join(repr(n) for n in nearest(end, links))
                what = f"joint {edge.joint.name!r} refers to an unknown link"
                raise RobotError(what, got=repr(end), needs=needs, try_=try_)
        if edge.child in parents:
            got = f"joints {parents[edge.child]!r} and {edge.joint.name!r}"
            raise RobotError(f"closed loop: link {edge.child!r} has two parents", got=got, needs="a tree")
        parents[edge.child] = edge.joint.name
        children[edge.parent].append(edge)
    roots = [link for link in links if link not in parents]
    if len(roots) > 1:
        got, try_ = listed(map(repr, roots)), "joining them by fixed joints"
        raise RobotError("more than one link has no parent", got=got, needs="one base", try_=try_)
    reached = list(roots)
    for link in reached:
        reached += [e.child for e in children[link]]
    if len(there := set(reached)) < len(links):
        got = listed(map(repr, (link for link in links if link not in there)))
        raise RobotError("closed loop: these links do not hang on a base", got=got, needs="a tree")
    return roots[0], children
