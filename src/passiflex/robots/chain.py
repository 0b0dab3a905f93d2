"""The kinematic and inertial description of a fixed-base serial arm.

Pure numbers in SI units. What is rigidly attached to a moving link is lumped into it; the names of the
source document stay here.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from passiflex.errors import NameUnknownError, PassiflexWarning, RobotError
from passiflex.robots.bodies import (
    HERE,
    PRINTED,
    Array,
    Body,
    Placement,
    check_body,
    lumped,
    rotation_of,
    rpy_of,
    triangle_defect,
    turned,
)
from passiflex.robots.chain_choice import Choice, Tree, choose, held_still, moved, placed
from passiflex.robots.urdf import read_document
from passiflex.robots.urdf_parts import COMPONENTS, LIMITS, UNLIMITED, Edge, Joint, listed

MOST_JOINTS = 100
DOWN = (0.0, 0.0, -9.81)
"""Gravitational acceleration in a world whose z points up [m/s²]."""


@dataclass(frozen=True, eq=False)
class SerialChain:
    """A serial arm on a fixed base: one body per joint, and the end-effector frame in the last moving link.

    Attributes
    ----------
    mount: Axes of the base, as columns, in a world whose z points up.

    Raises
    ------
    RobotError
        If joints and bodies differ in number, or a mass or an inertia is not positive (definite).
    """

    name: str
    joints: tuple[Joint, ...]
    bodies: tuple[Body, ...]
    tip_xyz: Array
    tip_rotation: Array
    mount: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        if not self.joints or len(self.joints) != len(self.bodies):
            got = f"{len(self.joints)} joints and {len(self.bodies)} bodies"
            raise RobotError("a chain has one body per joint", got=got, needs="at least one of each")
        for joint, body in zip(self.joints, self.bodies, strict=True):
            check_body(f"the link moved by joint {joint.name!r}", body, whole=True)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Return the gravitational acceleration in the axes of the base [m/s²]."""
        x, y, z = (np.array(DOWN) @ self.mount).tolist()
        return x, y, z

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return len(self.joints)

    @classmethod
    def from_urdf(
        cls,
        text_or_path: str | Path,
        end_effector: str | None = None,
        *,
        base: str | None = None,
        frozen: Mapping[str, float] | None = None,
    ) -> SerialChain:
        """Return the chain of a URDF document.

        Parameters
        ----------
        text_or_path: The document itself (any string with a `<`), or the path of its file.
        end_effector: The link that is held; None takes the last one of the longest chain.
        base: The link from which on joints move; None takes the root.
        frozen: Where other joints stand [rad, m]; 0 unless told, or amid a range without 0.

        Raises
        ------
        RobotError
            If the document is not a fixed-base serial arm with complete, physical numbers.
        NameUnknownError
            If `end_effector` is not a link of the document.

        Warns
        -----
        PassiflexWarning
            Of what the document can hardly mean: degrees, moments that no body has; and of what is not read of it.
        """
        chain, remarks, *_ = read_chain(text_or_path, end_effector, base=base, frozen=frozen)
        for remark in remarks:
            warnings.warn(remark, PassiflexWarning, stacklevel=2)
        return chain

    def with_tool(self, position: ArrayLike, rotation_vector: ArrayLike) -> SerialChain:
        """Return the arm with its end effector moved by `position` [m] and turned [rad], seen from where it was."""
        turn = Rotation.from_rotvec(np.asarray(rotation_vector, dtype=float)).as_matrix()
        tip = self.tip_xyz + self.tip_rotation @ np.asarray(position, dtype=float)
        return replace(self, tip_xyz=tip, tip_rotation=self.tip_rotation @ turn)

    def to_urdf(self, *, own_names: bool = False) -> str:
        """Return a canonical URDF document.

        Links are `base`, `link_1`, ... and `tip`, joints `joint_1`, ...; no limit is written as ±1e9. With
        `own_names`, robot and joints are called as in their source.
        """
        names = [j.name for j in self.joints] if own_names else [f"joint_{i + 1}" for i in range(self.n)]
        fixed = "tip_joint" + "_" * max(len(n) for n in names) if "tip_joint" in names else "tip_joint"
        out = [f"<robot name={quoteattr(self.name if own_names else 'arm')}>", '<link name="base"/>']
        if not np.array_equal(self.mount, np.eye(3)):
            out += [
                '<link name="world"/>',
                '<joint name="mount" type="fixed"><parent link="world"/><child link="base"/>',
                f"  {_tag('origin', xyz=np.zeros(3), rpy=rpy_of(self.mount))}",
                "</joint>",
            ]
        parent = "base"
        for i, (joint, body) in enumerate(zip(self.joints, self.bodies, strict=True), start=1):
            child = f"link_{i}"
            limits = {key: np.clip(getattr(joint, key), -UNLIMITED, UNLIMITED) for key in LIMITS}
            out += [
                f'<link name="{child}">',
                f"  <inertial>{_tag('origin', xyz=body.com, rpy=np.zeros(3))}{_tag('mass', value=body.mass)}",
                f"    {_tag('inertia', **dict(zip(COMPONENTS, body.inertia, strict=True)))}</inertial>",
                "</link>",
                f'<joint name={quoteattr(names[i - 1])} type="{joint.kind}">',
                f'  <parent link="{parent}"/><child link="{child}"/>',
                f"  {_tag('origin', xyz=joint.xyz, rpy=joint.rpy)}{_tag('axis', xyz=joint.axis)}",
                f"  {_tag('limit', **limits)}",
                "</joint>",
            ]
            parent = child
        out += [
            '<link name="tip"/>',
            f'<joint name="{fixed}" type="fixed">',
            f'  <parent link="{parent}"/><child link="tip"/>',
            f"  {_tag('origin', xyz=self.tip_xyz, rpy=rpy_of(self.tip_rotation))}",
            "</joint>",
            "</robot>",
        ]
        return "\n".join(out) + "\n"

    @property
    def joint_units(self) -> tuple[str, str, str]:
        """Return the units of joint position, velocity and torque, as "rad or m" for an arm that mixes their kinds."""
        turns, slides = ("rad", "rad/s", "N m"), ("m", "m/s", "N")
        kinds = {j.kind for j in self.joints}
        if len(kinds) == 1:
            return slides if kinds == {"prismatic"} else turns
        angle, speed, torque = (f"{a} or {b}" for a, b in zip(turns, slides, strict=True))
        return angle, speed, torque

    def unit_of(self, joint: int, unit: str) -> str:
        """Return the unit of one joint, counted from 0, of a quantity with one of the `joint_units`."""
        turning, _, sliding = unit.partition(" or ")
        return sliding if sliding and self.joints[joint].kind == "prismatic" else turning

    def triangle_defects(self) -> list[str]:
        """Return one line for every body whose principal moments no distribution of mass can have."""
        out = []
        for joint, body in zip(self.joints, self.bodies, strict=True):
            if moments := triangle_defect(body):
                out.append(f"the link moved by joint {joint.name!r} has principal moments {moments}")
        return out


class ReadChain(NamedTuple):
    """A chain, and a sentence on each thing of its document that it can hardly mean or that is not read.

    `held` says where the joints stand that hang on the arm and are not of it.
    """

    chain: SerialChain
    remarks: tuple[str, ...]
    choice: Choice
    held: Mapping[str, float]


def read_chain(
    text_or_path: str | Path,
    end_effector: str | None = None,
    *,
    base: str | None = None,
    frozen: Mapping[str, float] | None = None,
) -> ReadChain:
    """Return the chain of a URDF document as `SerialChain.from_urdf` does, with its remarks in place of warnings."""
    document, values = read_document(text_or_path), dict(frozen or {})
    choice = choose(document, base, end_effector)
    moving = choice.moving
    if len(moving) > MOST_JOINTS:
        raise RobotError("the robot has too many moving joints", needs=f"at most {MOST_JOINTS}")
    document.moving(moving)
    own, still = (
        {e.joint.name for e in moving},
        [e for leaving in document.children.values() for e in leaving],
    )
    held = held_still([e for e in still if not e.fixed and e.joint.name not in own], values)
    for name in values:
        if name not in held:
            raise NameUnknownError("joint that is not the arm's", name, held)
    poses = _rigid_part(choice.base, document.children, held)
    joints, bodies, hanging = [], [], []
    hardly: list[str] = []
    for edge in moving:
        joints.append(_seen_from(poses[edge.parent], edge.joint))
        poses = _rigid_part(edge.child, document.children, held)
        inertials = {link: body for link in poses if (body := document.inertial(link)) is not None}
        bodies.append(_lump(edge.child, poses, inertials))
        hanging += [e for link in poses for e in document.children[link] if e.joint.name in held]
        hardly += _hardly(poses, inertials)
    remarks = [*choice.remarks, *document.remarks, *hardly]
    if unsaid := [e for e in hanging if e.joint.name not in values]:
        remarks.append(f"held still: {listed(_standing(e, held) for e in unsaid)}")
    mount = placed(Tree(document).path(choice.base), held).rotation
    tip = poses[choice.tip]
    chain = SerialChain(document.name, tuple(joints), tuple(bodies), tip.xyz, tip.rotation, mount)
    return ReadChain(chain, tuple(remarks), choice, {e.joint.name: held[e.joint.name] for e in hanging})


def _standing(edge: Edge, held: Mapping[str, float]) -> str:
    unit = "m" if edge.joint.kind == "prismatic" else "rad"
    return f"joint {edge.joint.name!r} at {held[edge.joint.name]:.3g} {unit}"


def _hardly(links: Iterable[str], inertials: dict[str, Body]) -> Iterator[str]:
    """Yield a sentence on each link whose inertia no distribution of mass has."""
    for link in links:
        if link in inertials and (moments := triangle_defect(inertials[link], PRINTED)):
            what = f"link {link!r} has principal moments that no body has"
            yield f"{what}: {moments}; a digit or a decimal point may be missing in its <inertia>"


def _rigid_part(
    link: str, children: dict[str, list[Edge]], held: Mapping[str, float]
) -> dict[str, Placement]:
    """Return the poses of all links that are fixed to `link` or held still, in its frame."""
    poses = {link: HERE}
    queue = [link]
    for parent in queue:
        for edge in children[parent]:
            if edge.fixed or edge.joint.name in held:
                (xyz, R), step = poses[parent], moved(edge.joint, held.get(edge.joint.name, 0.0))
                poses[edge.child] = Placement(xyz + R @ step.xyz, R @ step.rotation)
                queue.append(edge.child)
    return poses


def _seen_from(parent: Placement, joint: Joint) -> Joint:
    """Return the joint with its origin in the frame in which `parent` is given."""
    if parent is HERE:
        return joint
    rpy = rpy_of(parent.rotation @ rotation_of(joint.rpy))
    return joint._replace(xyz=parent.xyz + parent.rotation @ joint.xyz, rpy=rpy)


def _lump(link: str, poses: dict[str, Placement], inertials: dict[str, Body]) -> Body:
    """Return all links that move with `link` as one body."""
    parts = []
    for name, pose in poses.items():
        if name in inertials:
            check_body(f"link {name!r}", inertials[name], whole=False)
            parts.append(turned(inertials[name], pose))
    if not parts:
        needs = "<inertial> in it or in a link fixed to it"
        raise RobotError(f"moving link {link!r} has no inertia", needs=needs)
    whole = lumped(parts)
    check_body(f"link {link!r}", whole, whole=True)
    return whole


def _tag(tag: str, **values: ArrayLike) -> str:
    """Return an element with numeric attributes that read back exactly."""
    texts = {key: " ".join(repr(float(x)) for x in np.ravel(value)) for key, value in values.items()}
    return f"<{tag} " + " ".join(f'{key}="{text}"' for key, text in texts.items()) + "/>"
