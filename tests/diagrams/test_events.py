"""Events come from the run itself: what its scenario asked for, what the governor held back, when it fell back."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from diagrams.seen import CONTROL, DRAG, PUSHED, altered, continuous, held_back, made_up
from passiflex.diagrams import Mark, Span, marks_of, spans_of
from passiflex.simulation import Run

REFERENCE = [
    {"at": 0.1, "kind": "step", "by": [0.03, 0.04, 0]},
    {"at": 0.2, "kind": "step", "by": [0, 0, 0], "turn": [0, 0.2, 0]},
    {"at": 0.3, "kind": "move", "by": [0, 0.1, 0], "duration": 0.1},
    {"at": 0.5, "kind": "circle", "plane": ["y", "z"], "radius": 0.1, "period": 1},
    {"at": 0.7, "kind": "hold"},
]
POSE = PUSHED["law"] | {
    "task": "pose",
    "stiffness": {"translation": 60, "rotation": 60},
    "damping": {"translation": 20, "rotation": 20},
}


def configured(**changes: object) -> Run:
    scenario = PUSHED | {"law": POSE, "reference": [], "forces": []} | changes
    return altered(continuous(), scenario=yaml.safe_dump(scenario))


def test_every_kind_of_reference_is_told() -> None:
    assert marks_of(configured(reference=REFERENCE)) == (
        Mark(0.1, "step 0.05 m"),
        Mark(0.2, "step 0.2 rad"),
        Mark(0.3, "move 0.1 m"),
        Mark(0.5, "circle"),
        Mark(0.7, "hold"),
    )


def test_forces_gains_drags_and_feed_forward_are_told_in_the_order_of_time() -> None:
    run = configured(
        control=CONTROL,
        forces=[
            {"from": 0.6, "to": 5, "force": [3, 4, 0], "moment": [0, 0, 2]},
            {"from": 0.3, "to": 0.4, "force": [0, 0, 1]},
            {"from": 0.45, "to": 0.5},
        ],
        feedforward=[{"from": 0.1, "to": 0.2, "force": [0, 0, 1]}],
        drags=DRAG,
        gains=[{"at": 0.7, "duration": 0.1, "stiffness": {"translation": 80, "rotation": 60}}],
    )
    assert marks_of(run) == (
        Mark(0.1, "feed-forward wrench"),
        Mark(0.3, "force 1 N"),
        Mark(0.45, "force 0 N"),
        Mark(0.5, "drag"),
        Mark(0.6, "force 5 N, moment 2 N m"),
        Mark(0.7, "gains change"),
    )
    assert Span(0.6, 1.0, "force 5 N, moment 2 N m", "force") in spans_of(run)  # it ends with the run
    assert len(spans_of(run)) == 5


def test_what_is_held_for_a_time_goes_by_its_name() -> None:
    """What is there throughout is no event: surfaces and end stops."""
    environment = [
        {"kind": "load", "name": "box", "from": 0.2, "to": 0.4, "mass": 0.5},
        {"kind": "person", "from": 0.6, "to": 3},
        {"kind": "drag", "from": 0.1, "to": 0.3, "viscous": 5},
        {"kind": "drag", "from": 0.5, "to": 0.7, "viscous": 5},
        {"kind": "plane", "point": [0, 0, -1], "normal": [0, 0, 1], "stiffness": 1e4},
        {"kind": "end_stops"},
    ]
    run = configured(environment=environment)
    assert spans_of(run) == (
        Span(0.2, 0.4, "box", "force"),
        Span(0.6, 1.0, "person", "force"),
        Span(0.1, 0.3, "drag", "force"),
        Span(0.5, 0.7, "drag_2", "force"),
    )
    assert [(m.time, m.label) for m in marks_of(run)] == [
        (0.1, "drag"),
        (0.2, "box"),
        (0.5, "drag_2"),
        (0.6, "person"),
    ]


def test_what_was_to_come_after_an_early_end_did_not_happen() -> None:
    run = configured(reference=REFERENCE, forces=[{"from": 0.6, "to": 0.8, "force": [0, 0, 1]}])
    cut = Run(run.data.isel(time=slice(0, 31)))  # to 0.3 s
    assert [mark.time for mark in marks_of(cut)] == [0.1, 0.2, 0.3]
    assert spans_of(cut) == ()


@pytest.mark.parametrize("text", ["", "name: [", "robot: iiwa14", "<b>no scenario</b>"])
def test_a_configuration_that_cannot_be_read_tells_nothing(text: str) -> None:
    assert marks_of(made_up(scenario=text)) == ()
    assert spans_of(made_up(scenario=text)) == ()


def test_the_governor_is_shown_from_the_first_row_that_is_held_back_to_the_row_after_the_last() -> None:
    run = held_back()
    spans = [span for span in spans_of(run) if span.kind == "governor"]
    held = (run["reference_share"] < 1) | (run["stiffness_share"] < 1)
    inside = np.zeros(run.time.size, dtype=bool)
    for span in spans:
        inside |= (run.time >= span.start) & (run.time < span.end)
    assert held.any()
    assert not held.all()
    assert not (held & ~inside)[:-1].any()
    extra = inside & ~held  # only pauses shorter than 0.05 s
    assert extra.sum() * 0.001 <= 0.05 * len(spans)


def shares(flags: list[int]) -> Run:
    """Return a run whose rows are 0.1 s apart, held back where the flag is 1."""
    run = made_up(count=len(flags), reference_share=1.0 - 0.5 * np.array(flags))
    return Run(run.data.assign_coords(time=0.1 * np.arange(len(flags))))


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ([0, 0, 0, 0], []),
        ([0, 1, 1, 0], [(0.1, 0.3)]),
        ([1, 0, 0, 1], [(0.0, 0.1), (0.3, 0.3)]),
        ([1, 1, 1, 1], [(0.0, 0.3)]),
    ],
)
def test_stretches_of_the_governor(flags: list[int], expected: list[tuple[float, float]]) -> None:
    assert [(s.start, s.end) for s in spans_of(shares(flags))] == [pytest.approx(e) for e in expected]


def test_it_is_said_what_was_held_back() -> None:
    """A share is written for both; a stretch may hold either back, or the one after the other."""
    reference = np.array([1, 0.5, 1, 1, 1, 1, 1, 0.5, 1, 1.0])
    stiffness = np.array([1, 1, 1, 1, 0.5, 1, 1, 1, 0.5, 1.0])
    run = made_up(count=10, reference_share=reference, stiffness_share=stiffness)
    run = Run(run.data.assign_coords(time=0.1 * np.arange(10)))
    assert [(round(s.start, 9), s.label) for s in spans_of(run)] == [
        (0.1, "reference held back"),
        (0.4, "stiffness held back"),
        (0.7, "reference and stiffness held back"),
    ]
    bare = Run(run.data.drop_vars("reference_share"))
    assert {s.label for s in spans_of(bare)} == {"stiffness held back"}


def test_a_stiffness_that_nobody_changes_is_not_held_back() -> None:
    """With an empty tank its share is below 1 all the same; the shipped circle with a drag is such a run."""
    reference = np.array([1, 0.5, 0.5, 1.0])
    run = made_up(count=4, reference_share=reference, stiffness_share=np.zeros(4))
    scenario = PUSHED | {"law": POSE, "reference": [], "forces": [], "control": CONTROL}
    change = {"at": 0.1, "duration": 0.1, "stiffness": {"translation": 80, "rotation": 80}}
    rows = "t,kx,ky,kz,krx,kry,krz\n0.1,80,80,80,80,80,80\n"
    in_tool = {"law": POSE | {"stiffness": {"translation": 60, "rotation": 60, "axes": "tool"}}}
    alone, both = "reference held back", "reference and stiffness held back"
    cases: list[tuple[dict[str, object], str]] = [
        ({}, alone),
        ({"gains": [change]}, both),
        ({"reference": {"rows": rows}}, both),
        ({"reference": {"rows": "t,x,y,z\n0.1,0,0,0\n", "relative": True}}, alone),
        (in_tool | {"reference": REFERENCE[:1]}, alone),
        (in_tool | {"reference": REFERENCE[:2]}, both),  # it turns
    ]
    for changes, label in cases:
        known = altered(run, scenario=yaml.safe_dump(scenario | changes))
        assert [s.label for s in spans_of(known) if s.kind == "governor"] == [label]


def test_stretches_that_nearly_touch_are_one() -> None:
    run = shares([0, 1, 0, 1, 0, 0])
    close = Run(run.data.assign_coords(time=0.02 * np.arange(6)))
    assert [(s.start, s.end) for s in spans_of(close)] == [pytest.approx((0.02, 0.08))]
    assert len(spans_of(run)) == 2


def test_a_thinned_file_still_says_that_the_reference_was_held_back() -> None:
    """Between two of its rows, in both of which nothing was."""
    run = made_up(count=5, governed_time=np.array([0, 0, 0.01, 0.01, 0.01]))
    assert [(s.start, s.end) for s in spans_of(run)] == [(0.5, 0.75)]


def test_the_fallback_lasts_to_the_end() -> None:
    run = made_up(count=5, latched=np.array([0.0, 0, 1, 1, 1]))
    assert spans_of(run) == (Span(0.5, 1.0, "fallen back", "fallback"),)
    assert marks_of(run) == (Mark(0.5, "fallen back"),)


def test_a_continuous_run_has_neither_governor_nor_fallback() -> None:
    assert {span.kind for span in spans_of(continuous())} == {"force"}
    assert [mark.label for mark in marks_of(continuous())] == ["step 0.05 m", "force 2 N", "circle"]
