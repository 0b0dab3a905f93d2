"""Solids: an arm that hangs together in every posture, ends where its kinematics end, and has no hole or spike."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arms import serial_chains
from passiflex.robots import SerialChain, catalogue
from passiflex.robots.catalogue import read_description
from passiflex.robots.chain import read_chain
from passiflex.robots.frames import world_frames
from passiflex.robots.solids import Solid, solids, with_solids
from passiflex.robots.urdf_parts import UNLIMITED

SEEDS = st.integers(0, 2**32 - 1)
CLOSE = 1e-9


def holds(solid: Solid, point: np.ndarray) -> bool:
    """Return whether a point of the body lies in the solid, or on it."""
    along, to = solid.end - solid.start, point - solid.start
    length = np.linalg.norm(along)
    share = to @ along / length**2 if length else 0.0
    if solid.kind == "cylinder":
        inside = -CLOSE <= share * length <= length + CLOSE
        return bool(inside and np.linalg.norm(to - share * along) <= solid.radius + CLOSE)
    return bool(np.linalg.norm(to - np.clip(share, 0, 1) * along) <= solid.radius + CLOSE)


def with_gaps_closed(chain: SerialChain, seed: int) -> SerialChain:
    """Return the chain with some of its offsets, and perhaps its tip, shrunk to nothing or nearly so."""
    rng = np.random.default_rng(seed)
    shrunk = [j._replace(xyz=j.xyz * rng.choice([0.0, 1e-3, 0.05, 1.0])) for j in chain.joints]
    return replace(chain, joints=tuple(shrunk), tip_xyz=chain.tip_xyz * rng.choice([0.0, 0.02, 1.0]))


def is_connected(parts: tuple[Solid, ...]) -> bool:
    """Return whether one can walk through all solids of a body: each new one has an end in those reached."""
    reached, left = [parts[0]], list(parts[1:])
    while left:
        for solid in left:
            points = [solid.start, solid.end, (solid.start + solid.end) / 2]
            if any(holds(r, p) for r in reached for p in points) or any(
                holds(solid, p) for r in reached for p in (r.start, r.end, (r.start + r.end) / 2)
            ):
                reached.append(solid)
                left.remove(solid)
                break
        else:
            return False
    return True


@settings(max_examples=150, deadline=None)
@given(chain=serial_chains(), seed=SEEDS)
def test_neighbours_hold_the_joint_between_them_and_a_body_is_one_piece(
    chain: SerialChain, seed: int
) -> None:
    """At a revolute joint both bodies hold the origin of the joint; on a rail the carriage's is held at any q."""
    chain = with_gaps_closed(chain, seed)
    half = 0.4 * sum(np.linalg.norm(xyz) for xyz in (*(j.xyz for j in chain.joints), chain.tip_xyz))
    spans = [np.clip((j.lower, j.upper), -half, half) for j in chain.joints]  # half: where no stop is
    q = np.array([np.random.default_rng(seed).uniform(*span) for span in spans])
    frames = world_frames(chain, q[None])
    bodies = solids(chain)
    assert len(bodies) == chain.n + 1
    for i, joint in enumerate(chain.joints):
        position, rotation = frames.position[0], frames.rotation[0]
        seen = rotation[i].T @ (position[i + 1] - position[i])  # origin of body i + 1 in body i
        assert any(holds(solid, seen) for solid in bodies[i]), f"body {i} does not reach joint {joint.name}"
        assert any(holds(solid, np.zeros(3)) for solid in bodies[i + 1])
    assert all(is_connected(body) for body in bodies)


@settings(max_examples=60, deadline=None)
@given(chain=serial_chains(), seed=SEEDS)
def test_numbers_are_finite_and_radii_taper_to_the_wrist(chain: SerialChain, seed: int) -> None:
    bodies = solids(with_gaps_closed(chain, seed))
    for body in bodies:
        for solid in body:
            assert np.isfinite([*solid.start, *solid.end, solid.radius]).all()
            assert solid.radius > 0
            assert (solid.kind == "sphere") == bool((solid.start == solid.end).all())
    links = [max((s.radius for s in b if s.kind == "capsule"), default=np.nan) for b in bodies]
    assert (np.diff([r for r in links if np.isfinite(r)]) < 0).all()


@settings(max_examples=60, deadline=None)
@given(chain=serial_chains())
def test_the_tool_ends_at_the_tip(chain: SerialChain) -> None:
    (tool,) = (solid for solid in solids(chain)[-1] if solid.part == "tool")
    if np.linalg.norm(chain.tip_xyz) > 2 * tool.radius:
        np.testing.assert_allclose(tool.end, chain.tip_xyz, atol=1e-12)
    assert holds(tool, chain.tip_xyz)


def test_a_rail_reaches_over_the_whole_travel_and_no_further_than_its_stops() -> None:
    chain = read_description("planar2r").chain
    slide = chain.joints[1]._replace(kind="prismatic", lower=0.1, upper=0.9)
    chain = replace(chain, joints=(chain.joints[0], slide))
    (rail,) = (s for s in solids(chain)[1] if s.part == "joint")
    for q in (0.0, 0.1, 0.9):
        assert holds(rail, slide.xyz + q * slide.axis)
    radius = 2 * rail.radius  # of the link, so that the carriage does not hang over its ends
    np.testing.assert_allclose(rail.start, slide.xyz - radius * slide.axis)
    np.testing.assert_allclose(rail.end, slide.xyz + (0.9 + radius) * slide.axis)
    (carriage, *_) = solids(chain)[2]
    assert carriage.part == "link"
    assert holds(carriage, np.zeros(3))


def test_a_travel_without_end_is_drawn_to_the_length_of_the_arm() -> None:
    chain = read_description("planar2r").chain
    slide = chain.joints[1]._replace(kind="prismatic", lower=-np.inf, upper=np.inf)
    (rail,) = (s for s in solids(replace(chain, joints=(chain.joints[0], slide)))[1] if s.part == "joint")
    assert 0.9 < np.linalg.norm(rail.end - rail.start) < 1.1  # links of 0.5 m and 0.4 m, and the stops


def test_an_arm_without_any_length_is_drawn_as_its_joints() -> None:
    chain = read_description("planar2r").chain
    joints = tuple(j._replace(xyz=np.zeros(3)) for j in chain.joints)
    bodies = solids(replace(chain, joints=joints, tip_xyz=np.zeros(3)))
    assert [[s.part for s in body] for body in bodies] == [["joint"], ["joint"], ["tool"]]
    assert all(0.005 < s.radius < 0.05 for body in bodies for s in body)


def test_the_iiwa_is_an_arm_of_seven_housings_that_turn_by_right_angles_in_turn() -> None:
    chain = read_description("iiwa14").chain
    bodies = solids(chain)
    frames = world_frames(chain, np.zeros((1, 7)))
    axes = []
    for i, body in enumerate(bodies[:-1]):
        (housing,) = (s for s in body if s.part == "joint")
        np.testing.assert_allclose((housing.start + housing.end) / 2, chain.joints[i].xyz, atol=1e-12)
        along = frames.rotation[0, i] @ (housing.end - housing.start)
        axes.append(np.abs(along / np.linalg.norm(along)))
    np.testing.assert_allclose(axes[::2], [[0, 0, 1]] * 4, atol=1e-12)  # along the stretched arm
    np.testing.assert_allclose(axes[1::2], [[0, 1, 0]] * 3, atol=1e-12)  # across it
    assert 0.05 < bodies[0][0].radius / 1.6 < 0.08  # the real one is some 0.14 m thick
    for s in bodies[0]:  # nothing is below the floor, no half sphere of a capsule either
        below = s.radius if s.kind == "capsule" else 0.0
        assert min(s.start[2], s.end[2]) >= below - CLOSE


def test_a_link_with_an_offset_leaves_along_its_own_axis_and_arrives_along_the_next() -> None:
    """The elbow of a Panda: 82.5 mm aside, then 384 mm along the axis of joint 5."""
    chain = read_description("iiwa14").chain
    elbow = chain.joints[4]._replace(xyz=np.array([-0.0825, 0.384, 0.0]))
    chain = replace(chain, joints=(*chain.joints[:4], elbow, *chain.joints[5:]))
    first, second = (s for s in solids(chain)[4] if s.kind == "capsule")
    np.testing.assert_allclose(first.end, [-0.0825, 0, 0], atol=1e-12)
    np.testing.assert_allclose(second.start, first.end)
    np.testing.assert_allclose(second.end, elbow.xyz)


@pytest.mark.parametrize("name", catalogue())
def test_the_urdf_with_solids_is_the_same_chain(name: str) -> None:
    chain = read_description(name).chain
    assert read_chain(with_solids(chain)).chain.to_urdf() == read_chain(chain.to_urdf()).chain.to_urdf()


@settings(max_examples=30, deadline=None)
@given(chain=serial_chains(), seed=SEEDS)
def test_the_visuals_are_the_solids(chain: SerialChain, seed: int) -> None:
    """Read by pinocchio's own code: number, place and direction of cylinders and spheres."""
    chain = with_gaps_closed(chain, seed)
    root = ET.fromstring(with_solids(chain))
    for i, body in enumerate(solids(chain)):
        link = next(e for e in root.iter("link") if e.get("name") == (f"link_{i}" if i else "base"))
        visuals = link.findall("visual")
        wanted: list[tuple[Solid, np.ndarray | None]] = []
        for s in body:
            wanted += [(s, None)] if s.kind != "sphere" else []
            wanted += [(s, s.start), (s, s.end)][: {"cylinder": 0, "sphere": 1, "capsule": 2}[s.kind]]
        assert len(visuals) == len(wanted)
        for visual, (solid, ball) in zip(visuals, wanted, strict=True):
            origin = visual.find("origin")
            assert origin is not None
            xyz, rpy = (np.array([float(w) for w in origin.get(k, "").split()]) for k in ("xyz", "rpy"))
            cylinder, sphere = (visual.find(f"geometry/{shape}") for shape in ("cylinder", "sphere"))
            if ball is None:
                assert cylinder is not None
                half = pin.rpy.rpyToMatrix(rpy)[:, 2] * float(cylinder.get("length", "nan")) / 2
                np.testing.assert_allclose(xyz - half, solid.start, atol=1e-12)
                np.testing.assert_allclose(xyz + half, solid.end, atol=1e-12)
                assert float(cylinder.get("radius", "nan")) == solid.radius
            else:
                assert sphere is not None
                np.testing.assert_array_equal(xyz, ball)
                assert float(sphere.get("radius", "nan")) == solid.radius
            colour = visual.find("material/color")
            assert colour is not None
            *_, opacity = (float(w) for w in colour.get("rgba", "").split())
            assert opacity == 1
    names = {e.get("name"): float(e.get("upper", "nan")) for e in root.iter("limit")}
    assert all(value <= UNLIMITED for value in names.values())
