"""What touches the hand is on the page: body, place, force, and nothing that a browser could not draw."""

from __future__ import annotations

import json

import numpy as np
import pytest

from passiflex.reports.surfaces import LARGEST, MOST
from reports.pages import page, sampled
from reports.surfaces import MISTOLD, said, touching

SHARP = {"rtol": 1e-6, "atol": 1e-7}


def test_each_surface_has_its_body_and_where_it_is() -> None:
    run = touching()
    read = page(run)
    wall, ball, post, crate = read.header["surfaces"]
    start = run["position"][0]
    assert [s["name"] for s in (wall, ball, post, crate)] == ["wall", "ball", "post", "crate"]
    assert [s["body"]["kind"] for s in (wall, ball, post, crate)] == ["plane", "sphere", "cylinder", "box"]
    assert [s["body"]["sizes"] for s in (wall, ball, post, crate)] == [
        [],
        [0.06],
        [0.05, None],
        [0.2, 0.3, 0.3],
    ]
    np.testing.assert_allclose(wall["body"]["place"], start + np.array([0.05, 0, 0]))
    np.testing.assert_allclose(np.reshape(wall["body"]["rotation"], (3, 3))[:, 2], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(ball["body"]["place"], start + np.array([-0.1, 0.1, 0.3]))
    np.testing.assert_allclose(post["body"]["place"], [0.4, 0.5, 0])
    assert (wall["shift"], post["shift"]) == (None, None)
    moved = read.array(ball["shift"])
    np.testing.assert_allclose(moved[[0, -1]], [[0, 0, 0], [0, 0, 0.1]], atol=1e-6)
    assert all(s["role"] in read.header["styles"] for s in (wall, ball, post, crate))


def test_a_plane_is_drawn_where_the_hand_is_next_to_it() -> None:
    (wall, *_) = page(said(point=[0.8, 7, -9], relative=False)).header["surfaces"]
    start = touching()["position"][0]
    np.testing.assert_allclose(wall["body"]["place"], [0.8, start[1], start[2]], atol=1e-12)


def test_force_and_depth_are_rows_of_the_run_and_the_rest_is_another_force() -> None:
    run = touching()
    read = page(run)
    frames, wall = read.header["frames"], read.header["surfaces"][0]
    rows = np.searchsorted(run.time, read.array(frames["time"]))
    np.testing.assert_allclose(read.array(wall["force"]), run["wall_force"][rows], **SHARP)
    np.testing.assert_allclose(read.array(wall["depth"]), run["wall_depth"][rows], **SHARP)
    assert np.abs(run["wrench"][:, :3]).max() > 1
    assert not read.array(frames["force"]).any()
    assert frames["moment"] is None


def test_the_mark_is_where_the_hand_touches() -> None:
    """On the face of the body that is drawn, or nearest to it on the hand's sphere; also of one that moves."""
    run = touching()
    assert run.scenario is not None
    read, hand = page(run), run.scenario.hand
    for surface in read.header["surfaces"]:
        point, depth = read.array(surface["point"]), read.array(surface["depth"]).ravel()
        rows = np.searchsorted(run.time, read.array(read.header["frames"]["time"]))
        place = np.array(surface["body"]["place"]) + (
            0 if surface["shift"] is None else read.array(surface["shift"])
        )
        local = (point - place) @ np.reshape(surface["body"]["rotation"], (3, 3))
        match surface["body"]["kind"]:
            case "plane":
                outside = local[:, 2]
            case "sphere":
                outside = np.linalg.norm(local, axis=1) - surface["body"]["sizes"][0]
            case "cylinder":
                outside = np.linalg.norm(local[:, :2], axis=1) - surface["body"]["sizes"][0]
            case _:
                outside = np.maximum(-depth, 0)
        np.testing.assert_allclose(outside, np.maximum(-depth, 0), atol=2e-5)
        centres = run["position"][rows][:, None] + np.einsum(
            "nij,pj->npi", run["rotation"][rows], np.array(hand.points)
        )
        away = np.linalg.norm(point[:, None] - centres, axis=2)
        held = hand.radius - np.maximum(depth, 0)
        assert (np.abs(away - held[:, None]) < 2e-5).any(axis=1).all()


def test_a_run_without_surfaces_has_none() -> None:
    assert page(sampled()).header["surfaces"] == []


@pytest.mark.parametrize("damage", MISTOLD)
def test_whatever_a_file_says_can_be_drawn(damage: str) -> None:
    header = page(MISTOLD[damage]()).header
    json.dumps(header, allow_nan=False)
    assert 0 < len(header["surfaces"]) <= MOST
    for surface in header["surfaces"]:
        if surface["body"] is not None:
            numbers = [*surface["body"]["place"], *(s for s in surface["body"]["sizes"] if s is not None)]
            assert np.abs(numbers).max() <= LARGEST
            axes = np.reshape(surface["body"]["rotation"], (3, 3))
            np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-6)


@pytest.mark.parametrize(
    ("damage", "notice"),
    [
        ("far", "Not drawn, but felt: wall; too large, too far, or not described."),
        (
            "no scenario",
            "Not drawn, but felt: wall, ball, post, crate; too large, too far, or not described.",
        ),
        ("many", "20 more surfaces are not drawn."),
    ],
)
def test_what_is_not_drawn_is_told(damage: str, notice: str) -> None:
    assert notice in page(MISTOLD[damage]()).header["notices"]


def test_the_facts_say_what_is_in_the_environment() -> None:
    facts = dict(map(tuple, page(touching()).header["facts"]))
    assert facts["plane wall"] == "20000 N/m, friction 0.3"
    assert facts["sphere ball"] == "radius 0.06 m, 20000 N/m, no friction, moved"
    assert facts["cylinder post"] == "radius 0.05 m, endless, 20000 N/m, no friction"
    assert facts["box crate"] == "0.2 × 0.3 × 0.3 m, 20000 N/m, no friction"
    assert facts["hand"] == "radius 20 mm"
