"""What touches the hand is shown by force and depth, as they are in the run."""

from __future__ import annotations

import numpy as np
import pytest

from diagrams.seen import altered, continuous, held_back, laden, touching, without
from passiflex.diagrams import Viewed, panels, touched
from passiflex.simulation import Run


def test_force_and_depth_are_those_of_the_run() -> None:
    run = touching()
    found = panels("contact", Viewed(run, "it"))
    assert [(p.kind, p.choice, p.unit) for p in found] == [
        ("contact", "force", "N"),
        *(("contact", f"force {axis}", "N") for axis in "xyz"),
        ("contact", "depth", "m"),
    ]
    assert {(c.label, c.role) for p in found for c in p.curves} == {("wall", "surface 1")}
    force, *along, depth = found
    for i, panel in enumerate(along):
        np.testing.assert_array_equal(panel.curves[0].values, run["wall_force"][:, i])
    np.testing.assert_allclose(force.curves[0].values, np.linalg.norm(run["wall_force"], axis=1))
    pressed = run["wall_depth"] > 0
    assert pressed.any()
    np.testing.assert_array_equal(depth.curves[0].values, np.where(pressed, run["wall_depth"], 0))
    assert force.curves[0].values[~pressed].max() == 0


def test_a_compared_run_stands_beside_it_where_it_has_the_surface() -> None:
    found = panels(
        "contact", Viewed(touching(), "it"), (Viewed(held_back(), "free"), Viewed(touching(), "as well"))
    )
    for panel in found:
        assert [(c.label, c.role) for c in panel.curves] == [
            ("wall", "surface 1"),
            ("wall, as well", "other 2"),
        ]


def test_a_compared_run_may_touch_something_else() -> None:
    first, second = Viewed(touching(), "it"), Viewed(laden(), "laden")
    (force, *_) = panels("contact", first, (second,))
    assert [(c.label, c.role) for c in force.curves] == [("wall", "surface 1"), ("load, laden", "other 1")]
    (force, *_) = panels("contact", second, (first,))
    assert [(c.label, c.role) for c in force.curves] == [("load", "surface 1"), ("wall, it", "other 1")]


def test_a_load_and_the_end_stops_are_shown_too() -> None:
    run = laden()
    found = {panel.choice: panel for panel in panels("contact", Viewed(run, "it"))}
    assert list(found) == ["force", "force x", "force y", "force z", "end stops"]
    (load,) = found["force z"].curves
    gripped = (run.time > 0.3995) & (run.time < 0.8005)
    assert load.label == "load"
    assert np.abs(load.values[~gripped]).max() == 0
    assert np.mean(load.values[gripped][200:]) == pytest.approx(-0.3 * 9.81, rel=0.1)
    assert "load" not in {span.label for panel in found.values() for span in panel.spans}
    (stop,) = found["end stops"].curves
    beyond = run["q"][:, 1] > 0.72
    assert stop.label == "joint 2"
    assert stop.values[beyond].max() < 0
    assert np.abs(stop.values[~beyond]).max() == 0


def test_without_surfaces_there_is_nothing_to_show() -> None:
    assert panels("contact", Viewed(continuous(), "it")) == ()
    assert panels("contact", Viewed(without(touching(), "wall_force"), "it")) == ()


def test_signals_that_only_have_the_name_are_no_surface() -> None:
    run = altered(touching(), scenario="")
    assert touched(run) == ("wall",)
    flat = Run(run.data.assign(wall_force=run.data["wall_depth"]))
    assert touched(flat) == ()


def test_a_gap_stays_a_gap() -> None:
    run = altered(touching())
    run.data["wall_force"][10:20] = np.nan
    run.data["wall_depth"][30:40] = np.nan
    force, *_, depth = panels("contact", Viewed(run, "it"))
    assert np.isnan(force.curves[0].values).sum() == 10
    assert np.isnan(depth.curves[0].values).sum() == 10
