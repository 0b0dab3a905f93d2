"""What is written in a URDF document but cannot be read: a default stands for what is absent, not for that."""

from __future__ import annotations

import difflib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Sequence

from passiflex.errors import RobotError
from passiflex.robots.urdf_xml import ATTRIBUTES, LEAVES, READ
from passiflex.texts.quantity import shown

_PLACED = (
    "pose", "position", "pos", "rotation", "rot", "orientation", "translation", "transform", "frame", "offset",
    "xyz", "rpy", "quat", "quat_xyzw", "com", "cog", "center_of_mass",
)  # fmt: skip
_LIMITED = (
    "limits",
    "range",
    "lower",
    "upper",
    "min",
    "max",
    "velocity",
    "effort",
    "max_velocity",
    "max_effort",
)
_ELSEWHERE = {
    "joint": dict.fromkeys(_PLACED, "origin") | dict.fromkeys(_LIMITED, "limit") | {"direction": "axis"},
    "inertial": dict.fromkeys(_PLACED, "origin"),
    "link": dict.fromkeys(("mass", "inertia", "com"), "inertial"),
    "origin": dict.fromkeys(("position", "pos", "translation", "offset"), "xyz")
    | dict.fromkeys(("rotation", "rot", "orientation", "euler"), "rpy"),
    "limit": {"min": "lower", "max": "upper", "speed": "velocity", "torque": "effort", "force": "effort"},
}
"""Element → words that other formats and people use → what URDF calls it."""
_HARMLESS = {
    "origin": ("name", "id"),
    "axis": ("name", "id"),
    "limit": ("name", "id", "acceleration", "deceleration", "jerk", "damping", "friction"),
}
"""Attributes that say nothing of what is read."""
SLIP, LONGEST = 0.75, 40
"""How alike a word and what was meant are, of 1, and letters beyond which no word was."""
_UNITS = ("unit", "units", "degrees", "angle_unit", "length_unit")


def refuse_unread(element: ET.Element, where: str, absent: Sequence[str]) -> None:
    """Raise RobotError if something in an element may stand for a part of it that is `absent`.

    Parameters
    ----------
    absent: Attributes and elements that are not there and for which a default would be taken.
    """
    for shape, name, attributes in _unknown(element):
        word = name.lower().replace("-", "_")
        meant = [*filter(None, [_ELSEWHERE.get(element.tag, {}).get(word)]), *_same(word, absent)]
        meant += [tag for tag in absent if tag in LEAVES and not attributes.isdisjoint(ATTRIBUTES[tag])]
        if element.tag in _HARMLESS:  # where every attribute is a number that is read
            if word in _UNITS:
                raise RobotError(
                    f"{where}: {shape} is not known to URDF", needs="m and rad, and no such attribute"
                )
            meant += [] if word in _HARMLESS[element.tag] else absent
        if found := [name for name in meant if name in absent]:
            what = f"{where}: {shape} cannot be read"
            known = [name for name in absent if name in found or name != "mimic"]
            needs = f"{' or '.join(_written(element.tag, name) for name in known)}, if anything"
            turned = ", the number that was first as the last" if word == "quat_wxyz" else ""
            raise RobotError(what, needs=needs, try_=_written(element.tag, found[0]) + turned)


def refuse_misspelt(root: ET.Element, source: str) -> None:
    """Raise RobotError for elements of a document that look like links or joints but are not called so."""
    for child in root:
        if child.tag not in READ["robot"] and (meant := _same(child.tag.lower(), READ["robot"])):
            raise RobotError(
                f"{source}: <{child.tag}> cannot be read", needs="<link> and <joint>", try_=f"<{meant[0]}>"
            )


def _same(word: str, known: Collection[str]) -> list[str]:
    """Return the known word that a word is but for a slip of the hand, which hits the first letter least."""
    alike = [name for name in known if name[:1] == word[:1]]
    return difflib.get_close_matches(word, alike, n=1, cutoff=SLIP) if len(word) <= LONGEST else []


def _unknown(element: ET.Element) -> Iterator[tuple[str, str, set[str]]]:
    """Yield how it is written, its name and attributes, of all in an element that is not read but for extensions."""
    for name in element.attrib:
        if name not in ATTRIBUTES.get(element.tag, ()) and ":" not in name and name != "xmlns":
            yield f"<{element.tag} {name}=...>", name, set()
    for child in element:
        if child.tag not in READ.get(element.tag, ()) and ":" not in child.tag:
            yield f"<{child.tag}> in <{element.tag}>", child.tag, set(child.attrib)
    if element.tag in LEAVES and element.text:
        yield f"the text {shown(element.text)} in <{element.tag}>", element.text, set()


def _written(tag: str, name: str) -> str:
    return f"{name}=..." if name in ATTRIBUTES.get(tag, ()) else f"<{name}>"
