"""The study of touch: its scenarios, what a wall felt, its figure, and what it shows."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt

from passiflex.plotting.contact import Approach, draw_approaches
from passiflex.simulation import resolve, simulate
from passiflex.studies.contact import LAWS, SPEEDS, STIFFNESSES, approach, approaches, felt


@pytest.mark.parametrize("law", LAWS)
def test_the_hand_comes_to_the_wall_with_the_speed_that_is_said(law: str) -> None:
    """The reference has it halfway, where the wall is."""
    scenario = approach(law, 1e4, 0.16)
    (move,) = scenario.reference
    time = move.at + move.duration / 2 + np.array([-1e-4, 1e-4])
    motion = resolve(scenario).events[1].motion
    assert motion is not None
    places = [motion["polynomial"][2] @ (t - move.at) ** np.arange(6) for t in time]
    assert abs(np.diff(places)[0]) / 2e-4 == pytest.approx(0.16, rel=1e-6)
    assert scenario.environment[0].point[2] == pytest.approx(-0.12)
    assert np.mean(places) - resolve(scenario).home.position[2] == pytest.approx(-0.1, abs=1e-9)


def test_gains_by_recommend_press_and_rest_where_the_papers_hammer() -> None:
    """At 1 kHz with a period of delay; the wall gets less than the hand stores, and far more from an active law."""
    ran = approaches(laws=("paper", "recommended"), stiffnesses=(1e5,), speeds=(0.16,))
    found = {law: felt(run) for law, _, _, run in ran}
    ours, paper = found["recommended"], found["paper"]
    assert ours.verdict == "passive"
    assert ours.peak < 140
    assert ours.steady == pytest.approx(500 * 0.1, rel=0.05)
    assert ours.bounces <= 5
    assert paper.verdict == "violated"
    assert paper.margin < 0
    assert paper.peak > 5 * ours.peak
    assert paper.given > 50 * ours.given


def test_the_law_of_public_controllers_has_no_tank_that_could_hold_it_back() -> None:
    """A scenario that names no tank has one, which held it back at 0.5 m/s."""
    run = simulate(approach("public", 1e4, 0.5))
    assert run["governed_time"][-1] == 0
    assert felt(run).peak == pytest.approx(153, abs=1)


def test_what_a_wall_felt_is_read_from_its_force() -> None:
    run = simulate(approach("recommended", 1e3, 0.5))
    numbers = felt(run)
    deepest = run["wall_storage"].argmax()
    whole = run["wall_storage"][deepest] + run["wall_energy"][deepest]
    assert numbers.given == pytest.approx(whole, rel=0.01)
    assert numbers.peak == pytest.approx(1e3 * run["wall_depth"].max() * 1.05, rel=0.1)


def test_the_figure_has_a_column_for_each_speed() -> None:
    time = np.linspace(0, 1, 5)
    rows = [
        Approach("law", engine, k, v, k / 1e3, 1.0, (time, time) if (k, engine) == (1e4, "passiflex") else None)
        for engine in ("passiflex", "mujoco") for k in STIFFNESSES for v in SPEEDS
    ]  # fmt: skip
    figure = draw_approaches(rows, "conditions")
    assert len(figure.axes) == 2 * len(SPEEDS) + 1
    assert [axes.get_title() for axes in figure.axes[:5:2]] == [f"{v:g} m/s" for v in SPEEDS]
    plt.close(figure)
