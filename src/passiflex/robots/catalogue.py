"""The robots that come with the package, and a user's own: links and joint data, each with its source."""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from multiprocessing import parent_process
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import NameUnknownError, PassiflexWarning, RobotError
from passiflex.robots.chain import SerialChain, read_chain
from passiflex.robots.doubts import doubts
from passiflex.robots.robot_entries import UNITS, Commanded
from passiflex.robots.robot_file import RobotFile, a_urdf, unreadable
from passiflex.robots.urdf_xml import MOST_BYTES
from passiflex.texts.kinds import another_file
from passiflex.texts.quantity import shown
from passiflex.texts.text_file import URDFS, UnreadableError, is_path, read_bytes

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """A robot in SI units: rad or m for each joint by its kind.

    `stiffness`, `damping`, `motor_inertia`, `torque_limit` and `velocity_limit` are (n,); `position_limit` is
    (n, 2), lower and upper bounds. `sources` says where numbers come from, by entry of the file and `links`.
    The arrays are read-only: whoever reads the same files gets the same description.
    """

    name: str
    description: str
    chain: SerialChain
    stiffness: Array
    damping: Array
    motor_inertia: Array
    torque_limit: Array
    velocity_limit: Array
    position_limit: Array
    sources: Mapping[str, str]
    ranges: Mapping[str, tuple[float, float]]
    sensed: bool
    commanded: Commanded | None


class _Known(NamedTuple):
    """A robot that was read, and what its two files held then."""

    content: bytes
    urdf: Path
    links: bytes
    robot: RobotDescription


_KNOWN: dict[Path, _Known] = {}


def catalogue() -> tuple[str, ...]:
    """Return the names of the robots that come with the package."""
    data = resources.files(__package__) / "data"
    return tuple(sorted(f.name.removesuffix(".yaml") for f in data.iterdir() if f.name.endswith(".yaml")))


def read_description(name_or_path: str | Path) -> RobotDescription:
    """Return a robot of the catalogue by name, or a user's by the path of its YAML file.

    It is the same object each time, until one of its files changes.

    Raises
    ------
    NameUnknownError
        If the name is not in the catalogue and no path (a path ends in .yaml or .yml, or has a folder in it).
    RobotError
        If a file is missing or malformed, or an entry has an unknown unit, a wrong size, an impossible value.

    Warns
    -----
    PassiflexWarning
        When the files of a user's robot are read, of numbers that can hardly be meant; not in a child process.
    """
    if not isinstance(name_or_path, str | Path) or not str(name_or_path).strip():
        needs = "a name of the catalogue, or the path of a robot file (.yaml)"
        raise RobotError(
            "no robot", got=shown(name_or_path), needs=needs, try_=f"one of {', '.join(catalogue())}"
        )
    if str(name_or_path).lstrip().startswith("<") or Path(name_or_path).suffix.lower() in URDFS:
        raise a_urdf(str(name_or_path))
    if is_path(name_or_path):
        return _read(Path(name_or_path))
    if name_or_path not in catalogue():
        if (other := another_file(Path(name_or_path), "robot file")) is not None:
            raise RobotError(f"{name_or_path}: {other}")
        raise NameUnknownError("robot", str(name_or_path), catalogue())
    with resources.as_file(resources.files(__package__) / "data" / f"{name_or_path}.yaml") as shipped:
        return _read(shipped, quiet=True)


def _read(path: Path, *, quiet: bool = False) -> RobotDescription:
    """Return the robot of one YAML file, the one that is known if both files hold what they held."""
    try:
        content = read_bytes(path)
    except UnreadableError as error:
        raise unreadable(path, error) from None
    known = _KNOWN.get(path)
    if known and known.content == content and known.links == _held(known.urdf):
        return known.robot
    written = RobotFile(path, content)
    entries = written.entries
    urdf = path.parent / entries.urdf
    if "\0" in entries.urdf or not os.path.exists(urdf):
        needs = "a path, absolute or from the folder of this file"
        raise written.mistake(("urdf",), ": no such file", got=repr(str(urdf)), needs=needs)
    links = _held(urdf)
    chain, remarks, *_ = read_chain(urdf, entries.end_effector, base=entries.base, frozen=written.frozen)
    chain = dataclasses.replace(chain, mount=entries.mount.rotation(chain.mount))
    values = {entry: written.numbers(entry, chain) for entry in UNITS}
    parts = (*chain.joints, *chain.bodies, (chain.tip_xyz, chain.tip_rotation, chain.mount), values.values())
    for array in (a for part in parts for a in part if isinstance(a, np.ndarray)):
        array.setflags(write=False)
    robot = RobotDescription(
        name=entries.name,
        description=entries.description,
        chain=chain,
        stiffness=values["joint_stiffness"],
        damping=values["joint_damping"],
        motor_inertia=values["motor_inertia"],
        torque_limit=values["torque_limit"],
        velocity_limit=values["velocity_limit"],
        position_limit=values["position_limit"],
        ranges=written.ranges,
        sensed=entries.torque_sensors,
        commanded=entries.commanded,
        sources={"links": entries.source} | {entry: written.source(entry) for entry in UNITS},
    )
    if not quiet and parent_process() is None:  # whose parent has said it
        for remark in (*remarks, *doubts(robot)):
            warnings.warn(f"{path}: {remark}", PassiflexWarning, stacklevel=3)
    if links is not None:
        _KNOWN[path] = _Known(content, urdf, links, robot)
    return robot


def _held(urdf: Path) -> bytes | None:
    """Return what a URDF file holds, or None where it cannot be read."""
    try:
        return read_bytes(urdf, MOST_BYTES)
    except UnreadableError:
        return None
