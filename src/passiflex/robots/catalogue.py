"""The robots that come with the package, and a user's own: links and joint data, each with its source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, StringConstraints, ValidationError

from passiflex.errors import NameUnknownError, RobotError
from passiflex.robots.chain import SerialChain, read_chain

Array = NDArray[np.float64]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]

DEGREE = np.pi / 180.0

UNITS: dict[str, dict[str, dict[str, float]]] = {
    "joint_stiffness": {
        "revolute": {"N m/rad": 1.0, "kN m/rad": 1e3, "N m/deg": 1 / DEGREE},
        "prismatic": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3},
    },
    "joint_damping": {
        "revolute": {"N m s/rad": 1.0, "N m s/deg": 1 / DEGREE},
        "prismatic": {"N s/m": 1.0, "N s/mm": 1e3},
    },
    "motor_inertia": {
        "revolute": {"kg m^2": 1.0, "kg cm^2": 1e-4},
        "prismatic": {"kg": 1.0},
    },
    "torque_limit": {
        "revolute": {"N m": 1.0},
        "prismatic": {"N": 1.0, "kN": 1e3},
    },
    "velocity_limit": {
        "revolute": {"rad/s": 1.0, "deg/s": DEGREE},
        "prismatic": {"m/s": 1.0, "mm/s": 1e-3},
    },
    "position_limit": {
        "revolute": {"rad": 1.0, "deg": DEGREE},
        "prismatic": {"m": 1.0, "mm": 1e-3},
    },
}
"""Entry → kind of joint → unit → factor to SI."""


class Quantity(BaseModel):
    """Numbers with their unit and their source; one number or unit serves all joints."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: float | list[float] | list[tuple[float, float]]
    unit: Text | list[Text]
    source: Text


class RobotFile(BaseModel):
    """A robot of the catalogue as it stands in its YAML file; `source` is that of the links."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Text
    description: Text
    urdf: Text
    end_effector: Text
    source: Text
    joint_stiffness: Quantity
    joint_damping: Quantity
    motor_inertia: Quantity
    torque_limit: Quantity
    velocity_limit: Quantity
    position_limit: Quantity


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
    """
    path = Path(name_or_path)
    if isinstance(name_or_path, Path) or path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        return _read(path)
    if name_or_path not in catalogue():
        raise NameUnknownError("robot", name_or_path, catalogue())
    with resources.as_file(resources.files(__package__) / "data" / f"{name_or_path}.yaml") as shipped:
        return _read(shipped)


def _read(path: Path) -> RobotDescription:
    """Return the robot of one YAML file, the one that is known if both files hold what they held."""
    try:
        content = path.read_bytes()
    except OSError as e:
        raise RobotError(f"robot file {str(path)!r} cannot be read", got=e, needs="a YAML file") from e
    known = _KNOWN.get(path)
    if known and known.content == content and known.links == _held(known.urdf):
        return known.robot
    file = _parse(path, content)
    urdf = path.parent / file.urdf
    if not urdf.is_file():
        needs = "a path, absolute or from the folder of this file"
        raise RobotError(f"{path}: entry urdf: no such file", got=repr(str(urdf)), needs=needs)
    links = _held(urdf)
    chain = read_chain(urdf, file.end_effector).chain
    values = {entry: _in_si(path, entry, getattr(file, entry), chain) for entry in UNITS}
    parts = (*chain.joints, *chain.bodies, (chain.tip_xyz, chain.tip_rotation), values.values())
    for array in (a for part in parts for a in part if isinstance(a, np.ndarray)):
        array.setflags(write=False)
    robot = RobotDescription(
        name=file.name,
        description=file.description,
        chain=chain,
        stiffness=values["joint_stiffness"],
        damping=values["joint_damping"],
        motor_inertia=values["motor_inertia"],
        torque_limit=values["torque_limit"],
        velocity_limit=values["velocity_limit"],
        position_limit=values["position_limit"],
        sources={"links": file.source} | {entry: getattr(file, entry).source for entry in UNITS},
    )
    if links is not None:
        _KNOWN[path] = _Known(content, urdf, links, robot)
    return robot


def _held(urdf: Path) -> bytes | None:
    """Return what a URDF file holds, or None where it cannot be read."""
    try:
        return urdf.read_bytes()
    except OSError:
        return None


def _parse(path: Path, data: bytes) -> RobotFile:
    """Return the entries of one YAML file, complete and of the right types."""
    try:
        content = yaml.safe_load(data.decode("utf-8"))
    except UnicodeDecodeError as e:
        raise RobotError(f"robot file {str(path)!r} cannot be read", got=e, needs="a YAML file") from e
    except yaml.YAMLError as e:
        mark = getattr(e, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        got = getattr(e, "problem", None) or e
        raise RobotError(f"{path} is not well-formed YAML{line}", got=got, needs="a YAML file") from e
    if not isinstance(content, dict):
        needs = f"the entries {', '.join(RobotFile.model_fields)}"
        raise RobotError(f"{path} is not a robot file", got=type(content).__name__, needs=needs)
    try:
        return RobotFile.model_validate(content)
    except ValidationError as e:
        raise RobotError(f"{path} has wrong entries", got="; ".join(_mistakes(e))) from e


def _mistakes(error: ValidationError) -> Iterator[str]:
    """Yield one line for each entry that is wrong."""
    seen = set()
    for mistake in error.errors():
        entry = ".".join(str(part) for part in mistake["loc"][:2])
        if entry not in seen:
            seen.add(entry)
            yield f"entry {entry}: {mistake['msg']}"


def _in_si(path: Path, entry: str, quantity: Quantity, chain: SerialChain) -> Array:
    """Return the numbers of one entry in SI units, one for each joint; position limits as pairs."""
    where, n = f"{path}: entry {entry}", chain.n
    units = [quantity.unit] * n if isinstance(quantity.unit, str) else quantity.unit
    if len(units) != n:
        raise RobotError(f"{where}.unit has the wrong size", got=len(units), needs=f"one unit, or {n}")
    factors = np.empty(n)
    for i, (unit, joint) in enumerate(zip(units, chain.joints, strict=True)):
        known = UNITS[entry][joint.kind]
        if unit not in known:
            what = f"{where}.unit does not fit {joint.kind} joint {i + 1}"
            raise RobotError(what, got=repr(unit), needs=f"one of {', '.join(known)}")
        factors[i] = known[unit]

    value = np.array(quantity.value, dtype=float)
    if value.ndim == 0:
        value = np.full(n, value)
    pairs = entry == "position_limit"
    if value.shape != (n,) and not (pairs and value.shape == (n, 2)):
        needs = f"one number, {n} numbers{f', or {n} pairs [lower, upper]' if pairs else ''}"
        raise RobotError(f"{where}.value has the wrong size", got=value.shape, needs=needs)
    if value.ndim == 2:
        if not (value[:, 0] < value[:, 1]).all():
            needs = "pairs with lower < upper"
            raise RobotError(f"{where}.value is impossible", got=value.tolist(), needs=needs)
        return value * factors[:, None]
    finite = np.isfinite(value) if not entry.endswith("limit") else ~np.isnan(value)
    if not (finite & (value > 0)).all():
        needs = "numbers above 0" if entry.endswith("limit") else "finite numbers above 0"
        raise RobotError(f"{where}.value is impossible", got=value.tolist(), needs=needs)
    value = value * factors
    return np.stack([-value, value], axis=1) if pairs else value
