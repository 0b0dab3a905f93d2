"""The signals of a run as ROS 2 topics: for each the message that programs know best."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from passiflex.exports.quaternions import quaternions
from passiflex.exports.signals import Signal
from passiflex.robots.bodies import Array
from passiflex.robots.chain import SerialChain
from passiflex.robots.frames import relative_frames

Message = Mapping[str, Any]

JOINTS = {"/joint_states": ("q", "dq", "tau_a"), "/motor_states": ("theta", "dtheta", "tau_m")}
"""Topic → signals that are its position, velocity and effort."""
FIELDS = ("position", "velocity", "effort")
POSES = {
    "/end_effector": ("position", "rotation"),
    "/reference": ("desired_position", "desired_rotation"),
    "/governed_reference": ("governed_position", "governed_rotation"),
}
CONTACT = "contact"
"""Frame at the end effector with the axes of the base: the one in which the wrench is given."""


class Topic(NamedTuple):
    """A channel of the file: name, type, units by field, and its message at a row, None where there is none."""

    name: str
    kind: str
    units: Mapping[str, tuple[str, ...]]
    message: Callable[[int], Message | None]


def topics_of(chain: SerialChain | None, signals: Sequence[Signal], time: Sequence[int]) -> Iterator[Topic]:
    """Yield the topics of signals whose rows are at `time` [ns]; an arm's frames only where there is an arm."""
    known = {signal.name: signal for signal in signals}
    headers = [{"sec": t // 10**9, "nanosec": t % 10**9} for t in time]
    taken: set[str] = set()
    if chain is not None:
        yield Topic("/tf", "tf2_msgs/TFMessage", {"translation": ("m",)}, _transforms(chain, known, headers))
    for name, parts in JOINTS.items():
        if parts[0] in known:
            taken.update(parts)
            units = {f: known[p].units for f, p in zip(FIELDS, parts, strict=True) if p in known}
            joints = [joint.name for joint in chain.joints] if chain is not None else []
            states = _joint_states(known, parts, headers, joints)
            yield Topic(name, "sensor_msgs/JointState", units, states)
    beside = None  # all poses on one side: the error of a tool that points down is no jump
    for name, (position, rotation) in POSES.items():
        if position in known and rotation in known:
            taken.update((position, rotation))
            poses = _poses(known[position].values, known[rotation].values, beside)
            beside = beside if beside is not None else _first_turn(poses)
            message = _stamped("pose", poses, headers, "base")
            yield Topic(name, "geometry_msgs/PoseStamped", {"position": ("m",)}, message)
    if "wrench" in known:
        taken.add("wrench")
        wrenches = [{"force": _xyz(w[:3]), "torque": _xyz(w[3:])} for w in known["wrench"].values.tolist()]
        frame = CONTACT if chain is not None else "base"
        message, units = _stamped("wrench", wrenches, headers, frame), {"force": ("N",), "torque": ("N m",)}
        yield Topic("/wrench", "geometry_msgs/WrenchStamped", units, message)
    for signal in signals:
        if signal.name not in taken:
            yield _plain(signal)


def _topic_name(signal: str) -> str:
    """Return the topic of a signal that stands alone: energies and powers have a room of their own."""
    for quantity in ("energy", "power"):
        if signal.endswith(f"_{quantity}"):
            return f"/{quantity}/{signal.removesuffix(f'_{quantity}')}"
    return f"/signal/{signal}"


def _plain(signal: Signal) -> Topic:
    """Return a signal as numbers without a meaning of their own."""
    name, units, rows = _topic_name(signal.name), {"data": signal.units}, signal.values.tolist()
    if signal.columns == (signal.name,):
        return Topic(name, "std_msgs/Float64", units, lambda row: {"data": rows[row][0]})
    size = len(signal.columns)
    layout = {"dim": [{"label": " ".join(signal.titles), "size": size, "stride": size}], "data_offset": 0}
    return Topic(name, "std_msgs/Float64MultiArray", units, lambda row: {"layout": layout, "data": rows[row]})


def _transforms(
    chain: SerialChain, known: Mapping[str, Signal], headers: Sequence[Message]
) -> Callable[[int], Message | None]:
    """Return the frames of the arm, each in the one before it, and the contact's in that of the base."""
    frames = relative_frames(chain, known["q"].values)
    names = ["base", *(f"link_{i + 1}" for i in range(chain.n)), "tip"]
    columns = []
    for i, (parent, child) in enumerate(pairwise(names), start=1):
        poses = _poses(frames.position[:, i], frames.rotation[:, i])
        columns.append((parent, child, poses))
    if "position" in known:
        upright = np.tile(np.eye(3), (len(headers), 1, 1))
        columns.append(("base", CONTACT, _poses(known["position"].values, upright)))

    def message(row: int) -> Message | None:
        transforms = [
            {
                "header": {"stamp": headers[row], "frame_id": parent},
                "child_frame_id": child,
                "transform": {"translation": pose["position"], "rotation": pose["orientation"]},
            }
            for parent, child, poses in columns
            if (pose := poses[row]) is not None
        ]
        return {"transforms": transforms} if transforms else None

    return message


def _joint_states(
    known: Mapping[str, Signal], parts: Sequence[str], headers: Sequence[Message], joints: Sequence[str]
) -> Callable[[int], Message]:
    """Return position, velocity and effort by joint; what the run lacks is empty, as ROS has it.

    Joints are called as the robot's own description does, or joint_1, ... where there is none.
    """
    numbers = [known[part].values.tolist() if part in known else None for part in parts]
    count = len(known[parts[0]].columns)
    names = list(joints) if len(joints) == count else [f"joint_{i + 1}" for i in range(count)]

    def message(row: int) -> Message:
        values = [rows[row] if rows is not None else [] for rows in numbers]
        header = {"stamp": headers[row], "frame_id": ""}
        return {"header": header, "name": names, **dict(zip(FIELDS, values, strict=True))}

    return message


def _stamped(
    field: str, values: Sequence[Message | None], headers: Sequence[Message], frame: str
) -> Callable[[int], Message | None]:
    """Return a value with time and frame."""

    def message(row: int) -> Message | None:
        if values[row] is None:
            return None
        return {"header": {"stamp": headers[row], "frame_id": frame}, field: values[row]}

    return message


def _poses(position: Array, rotation: Array, beside: Array | None = None) -> list[Message | None]:
    """Return poses of positions (N, 3) and rotations (N, 3, 3), None where one is not finite.

    Parameters
    ----------
    beside: A quaternion on whose side the first one is.
    """
    rotation = rotation.reshape(-1, 3, 3)
    poses: list[Message | None] = [None] * len(position)
    good = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2)))
    if good.size:
        turns = quaternions(rotation[good], beside)
        for row, p, turn in zip(good.tolist(), position[good].tolist(), turns.tolist(), strict=True):
            poses[row] = {"position": _xyz(p), "orientation": dict(zip("xyzw", turn, strict=True))}
    return poses


def _first_turn(poses: Sequence[Message | None]) -> Array | None:
    """Return the first quaternion of poses, None where there is none."""
    first = next((pose["orientation"] for pose in poses if pose is not None), None)
    return None if first is None else np.array([first[axis] for axis in "xyzw"])


def _xyz(numbers: Sequence[float]) -> Message:
    return dict(zip("xyz", numbers, strict=True))
