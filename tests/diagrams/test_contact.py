"""What touches the hand is shown by force and depth, as they are in the run."""

from __future__ import annotations

import numpy as np

from diagrams.seen import altered, continuous, held_back, touching, without
from passiflex.diagrams import Viewed, panels, touched
from passiflex.simulation import Run


def test_force_and_depth_are_those_of_the_run() -> None:
    run = touching()
    force, depth = panels("contact", Viewed(run, "it"))
    assert [(p.kind, p.choice, p.unit) for p in (force, depth)] == [
        ("contact", "force", "N"),
        ("contact", "depth", "m"),
    ]
    assert [(c.label, c.role) for p in (force, depth) for c in p.curves] == [("wall", "surface 1")] * 2
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
    force, depth = panels("contact", Viewed(run, "it"))
    assert np.isnan(force.curves[0].values).sum() == 10
    assert np.isnan(depth.curves[0].values).sum() == 10
