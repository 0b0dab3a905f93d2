"""A robot file for a URDF: the chain, the limits and masses that were found, and estimates for what no URDF knows."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from passiflex.robots.bodies import Array
from passiflex.robots.chain import ReadChain, SerialChain, read_chain
from passiflex.robots.drives import Drive, Estimate, drive_of, with_slides
from passiflex.robots.once_over import weights
from passiflex.robots.robot_entries import UNITS

HEADROOM = 2.0
"""How many times its weight a joint is taken to bear whose torque rating is not known."""
LEAST_RATING = 1.0
"""[N m] For joints that carry no weight."""
NO_TEXT = {"null", "true", "false", "yes", "no", "on", "off", "y", "n"}
"""Words that YAML takes for something else than text."""
NUMBERED = re.compile(r"[^A-Za-z0-9_.-]+")


class NewFile(NamedTuple):
    """A robot file as text, what was read for it, and the class of drives that its estimates are of."""

    text: str
    read: ReadChain
    drive: str
    estimates: Mapping[str, Estimate]


def new_robot_file(
    urdf: str | Path,
    *,
    base: str | None = None,
    end_effector: str | None = None,
    frozen: Mapping[str, float] | None = None,
    drive: str | None = None,
    folder: Path | None = None,
    name: str | None = None,
) -> NewFile:
    """Return a commented robot file for an arm of a URDF.

    Parameters
    ----------
    base, end_effector: Links between which the arm is; without them the longest chain.
    frozen: Where other joints stand [rad, m].
    drive: Class of the drives, one of `drives.DRIVES`; by the arm's strength if left out.
    folder: In which the file will lie; that of the URDF if left out.
    name: Of the robot; that of the URDF's file if left out.

    Raises
    ------
    PassiflexError
        If the URDF cannot be read, has several longest chains, or a name is unknown.
    """
    path = Path(urdf)
    read = read_chain(path, end_effector, base=base, frozen=frozen)
    chain, told = read.chain, ratings(read.chain)
    rating = np.where(np.isnan(told), _needed(chain), told)
    slides = np.array([joint.kind == "prismatic" for joint in chain.joints])
    called, kind = drive_of(drive, rating[~slides])
    carried = np.cumsum([body.mass for body in chain.bodies[::-1]])[::-1]
    estimates = with_slides(kind.estimates(rating), slides, carried)
    where = path.name if folder is None or folder.resolve() == path.parent.resolve() else str(path.resolve())
    lines = [*_head(path, read, where, NUMBERED.sub("_", name or path.stem))]
    lines += [f"torque_sensors: {str(kind.sensed).lower()}   # assumed, of this class of drives"]
    lines += [*_joint_lines(chain), *_estimated(estimates, called, kind, chain)]
    lines += _ratings(rating, told, chain)
    return NewFile("\n".join(lines) + "\n", read, called, estimates)


def ratings(chain: SerialChain) -> Array:
    """Return the torque ratings that a URDF says, nan where it says none: 0, or no limit."""
    effort = np.array([joint.effort for joint in chain.joints])
    return np.where(np.isfinite(effort) & (effort > 0), effort, np.nan)


def _needed(chain: SerialChain) -> Array:
    limits = np.array([[j.lower, j.upper] for j in chain.joints])
    heaviest = np.abs(weights(chain, limits)).max(axis=0)
    return np.asarray(np.maximum(HEADROOM * heaviest, LEAST_RATING))


def _head(path: Path, read: ReadChain, where: str, name: str) -> Iterator[str]:
    chain, choice = read.chain, read.choice
    yield f"# {name}: written by `passiflex robot new`; what says assumed is an estimate: replace it by what you know."
    yield f"name: {_quoted(name)}"
    yield f"description: {chain.n} joints of {path.name}, from {choice.base} to {choice.tip}"
    yield f"urdf: {_quoted(where)}"
    yield f"base: {_quoted(choice.base)}"
    yield f"end_effector: {_quoted(choice.tip)}"
    if read.held:
        inside = ", ".join(f"{_quoted(joint)}: {value:.6g}" for joint, value in read.held.items())
        yield "# Joints on the arm that are not of it: where they stand, rad or m."
        yield f"frozen: {{{inside}}}"
    if not np.array_equal(chain.mount, np.eye(3)):
        yield "# The base is turned against the first link of the URDF, whose z is taken to point up."
    yield "# mount: {on: wall}   # or floor, ceiling; {rpy: [0, 30 deg, 0]}; {gravity: [0, -9.81, 0]} in its axes"
    yield f"source: {path.name} as it was found; say where it is from"


def _joint_lines(chain: SerialChain) -> Iterator[str]:
    yield "# What was found in it:"
    width = max(len(j.name) for j in chain.joints)
    for joint, body in zip(chain.joints, chain.bodies, strict=True):
        unit = "m" if joint.kind == "prismatic" else "rad"
        span = f"{joint.lower:.3g} to {joint.upper:.3g} {unit}"
        most = f"{joint.velocity:.3g} {unit}/s, {joint.effort:.4g} {'N' if unit == 'm' else 'N m'}"
        yield f"#   {joint.name:{width}}  a link of {body.mass:.3g} kg, {span}, {most}"


def _estimated(
    estimates: Mapping[str, Estimate], name: str, drive: Drive, chain: SerialChain
) -> Iterator[str]:
    yield f"# No URDF knows K, D and B. Estimated for {drive.title} (--drive {name}); a data sheet, a paper or a"
    yield "# measurement is better, and `range` says between which shares of them answers are to be looked at."
    for entry, estimate in estimates.items():
        yield f"{entry}:"
        yield f"  value: {_listed(estimate.value)}"
        yield f"  unit: {_unit(entry, chain)}"
        yield f"  range: [{estimate.low:.3g}, {estimate.high:.3g}]"
        yield from textwrap.wrap(
            f"assumed: {estimate.why}", 100, initial_indent="  source: >-\n    ", subsequent_indent="    "
        )


def _ratings(rating: Array, told: Array, chain: SerialChain) -> Iterator[str]:
    if not np.isnan(told).any():
        yield "# Torque, speed and position limits are those of the URDF unless they are written here."
        return
    yield "# The URDF has no torque limit for all joints: what is missing is twice the largest weight."
    yield "torque_limit:"
    yield f"  value: {_listed(rating)}"
    yield f"  unit: {_unit('torque_limit', chain)}"
    yield "  source: assumed where the URDF says none, as twice the largest gravity torque"


def _unit(entry: str, chain: SerialChain) -> str:
    units = [next(iter(UNITS[entry][joint.kind])) for joint in chain.joints]
    return units[0] if len(set(units)) == 1 else f"[{', '.join(units)}]"


def _listed(values: Sequence[float] | Array) -> str:
    return f"[{', '.join(f'{v:.3g}' for v in values)}]"


def _quoted(text: str) -> str:
    """Return a text as YAML reads it."""
    plain = re.fullmatch(r"[A-Za-z_][A-Za-z0-9_./-]*", text) and text.lower() not in NO_TEXT
    return text if plain else "'" + text.replace("'", "''") + "'"
