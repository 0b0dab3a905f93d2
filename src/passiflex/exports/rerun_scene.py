"""The three-dimensional part of a Rerun recording: the arm, its end effector, the reference, the force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from passiflex.diagrams.viewed import first_finite
from passiflex.exports.quaternions import quaternions
from passiflex.exports.rerun_stream import BLUE, GREY, ORANGE, PINK, RED, Colour, Stream
from passiflex.robots.bodies import Array
from passiflex.robots.chain import SerialChain
from passiflex.robots.frames import relative_frames
from passiflex.robots.solids import COLOURS, Solid, solids, with_solids
from passiflex.runs.run import Run
from passiflex.runs.run_arm import chain_of

LONGEST_ARROW = 0.25
"""Length of the arrow of the largest force [m]."""


def log_scene(stream: Stream, run: Run, ideal: Array | None) -> None:
    """Log what a run has of all this below `world/`; `ideal` (N, 3) m is the ideal end effector's displacement."""
    rr, chain = stream.rr, chain_of(run)
    stream.constant(["world"], rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    if chain is not None:
        stream.constant(["robot_description"], rr.TextDocument(with_solids(chain)))
        _log_arm(stream, chain, run)
    if "position" not in run.data:
        return
    position, time = run["position"], run.time
    size = 0.03 * max(float(np.abs(position[np.isfinite(position)]).max(initial=0.0)), 0.1)
    _log_path(stream, "end_effector", position, BLUE, size / 4)
    _log_point(stream, "end_effector", time, position, BLUE, size)
    for name, signal, colour in (
        ("reference", "desired_position", GREY),
        ("reference_in_force", "governed_position", ORANGE),
    ):
        if signal in run.data:
            _log_path(stream, name, run[signal], colour, size / 8)
            _log_point(stream, name, time, run[signal], colour, size)
    if ideal is not None:
        _log_point(stream, "ideal", time, first_finite(position) + ideal, PINK, 0.8 * size)
    if "wrench" in run.data:
        _log_force(stream, time, position, run["wrench"][:, :3], size / 2)


def _log_arm(stream: Stream, chain: SerialChain, run: Run) -> None:
    """Log the bodies, each below the one that carries it, with its motion relative to that one."""
    frames, bodies = relative_frames(chain, run["q"]), solids(chain)
    place = ["world", "base"]
    for i, name in enumerate(["base", *(f"link_{i + 1}" for i in range(chain.n)), "tip"]):
        if i:
            place = [*place, name]
            position, rotation = frames.position[:, i], frames.rotation[:, i]
            good = np.isfinite(position).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
            if good.any():
                turns = quaternions(rotation[good])
                moves = stream.rr.Transform3D.columns(translation=position[good], quaternion=turns)
                stream.columns(place, run.time[good], moves)
        if i < len(bodies):
            _log_solids(stream, place, bodies[i])


def _log_solids(stream: Stream, place: Sequence[str], body: Sequence[Solid]) -> None:
    """Log the solids of one body; Rerun's capsules begin at their origin, its cylinders have it in the middle."""
    rr, filled = stream.rr, stream.rr.components.FillMode.Solid
    for kind in ("capsule", "cylinder", "sphere"):
        some = [solid for solid in body if solid.kind == kind]
        if not some:
            continue
        look = {"colors": [[float(w) for w in COLOURS[s.part].split()] for s in some], "fill_mode": filled}
        middles, radii = [(s.start + s.end) / 2 for s in some], [s.radius for s in some]
        if kind == "sphere":
            value = rr.Ellipsoids3D(centers=middles, radii=radii, **look)
        else:
            lengths = [float(np.linalg.norm(s.end - s.start)) for s in some]
            look |= {"lengths": lengths, "radii": radii, "quaternions": [_turn(s) for s in some]}
            if kind == "capsule":
                value = rr.Capsules3D(translations=[s.start for s in some], **look)
            else:
                value = rr.Cylinders3D(centers=middles, **look)
        stream.constant([*place, f"{kind}s"], value)


def _turn(solid: Solid) -> Array:
    """Return the quaternion (x, y, z, w) that turns z into the direction of a solid."""
    x, y, z = solid.end - solid.start
    return Rotation.from_euler("yz", [np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)]).as_quat()


def _log_path(stream: Stream, name: str, position: Array, colour: Colour, radius: float) -> None:
    """Log the whole way of a point, broken where it is not known."""
    good = np.isfinite(position).all(axis=1)
    pieces = np.split(position, np.flatnonzero(np.diff(good)) + 1)
    strips = [piece for piece in pieces if np.isfinite(piece).all()]
    stream.constant(
        ["world", name, "path"],
        stream.rr.LineStrips3D(strips, colors=[colour] * len(strips), radii=[radius] * len(strips)),
    )


def _log_point(
    stream: Stream, name: str, time: Array, position: Array, colour: Colour, radius: float
) -> None:
    """Log a point that moves."""
    rr, good = stream.rr, np.isfinite(position).all(axis=1)
    stream.constant(["world", name], rr.Points3D.from_fields(colors=[colour], radii=[radius]))
    stream.columns(["world", name], time[good], rr.Points3D.columns(positions=position[good]))


def _log_force(stream: Stream, time: Array, position: Array, force: Array, radius: float) -> None:
    """Log the external force as an arrow that ends at the end effector, and its scale."""
    rr, good = stream.rr, np.isfinite(position).all(axis=1) & np.isfinite(force).all(axis=1)
    largest = float(np.linalg.norm(force[good], axis=1).max(initial=0.0))
    scale = LONGEST_ARROW / largest if largest > 0 else 0.0
    arrows, place = scale * force[good], ["world", "external_force"]
    stream.constant(place, rr.Arrows3D.from_fields(colors=[RED], radii=[radius]))
    stream.constant(place, rr.AnyValues(metres_per_newton=scale))
    stream.columns(place, time[good], rr.Arrows3D.columns(vectors=arrows, origins=position[good] - arrows))
