"""The figures of the studies of touch: what is in them, without a run."""

from __future__ import annotations

import numpy as np
from matplotlib import pyplot as plt

from passiflex.campaigns.intervals import share_of
from passiflex.plotting.grip import Lifted, draw_grip
from passiflex.plotting.hands import Pressed, draw_hands
from passiflex.plotting.policy import Guarded, draw_policy
from passiflex.plotting.polishing import Polished, draw_polishing
from passiflex.plotting.walls import Decade, draw_walls
from passiflex.studies.gliding import Steady
from passiflex.studies.polishing import Polishing

TIME = np.linspace(0, 1, 5)


def test_each_press_has_its_tank_its_way_and_its_closed_form() -> None:
    found = Polishing(9.0, 0.01, 0.5, 10.0, 4.5, 4.6, 4.6, 1.2, 10.0, 0.3, "passive")
    rows = [
        Polished(force, mu, TIME, 5 - TIME, found, Steady(9.1, 0.01, 0.1, 0.4))
        for force in (5.0, 10.0, 20.0) for mu in (0.2, 0.4, 0.6)
    ]  # fmt: skip
    figure = draw_polishing(
        rows, {"depth": (TIME, TIME), "valve": (TIME, TIME)}, np.array([[1, 9], [5, 1]]), "here"
    )
    level, way, after, *_ = figure.axes
    assert len(level.lines) == 9
    assert len(way.lines) == 10
    assert [text.get_text() for text in after.get_legend().get_texts()] == ["depth", "valve"]
    plt.close(figure)


def test_each_way_to_hold_a_load_is_in_all_three_panels() -> None:
    ways = [Lifted(name, TIME, TIME, 5 - TIME, TIME, 2 * TIME) for name in ("a", "b", "c")]
    figure = draw_grip(ways, (TIME, TIME), 0.04, 2.0, "here")
    height, tank, read = figure.axes
    assert [len(axes.lines) for axes in (height, tank, read)] == [5, 3, 4]
    assert "40.0 mm" in height.texts[0].get_text()
    plt.close(figure)


def test_a_policy_without_a_tank_stands_beside_those_with_one() -> None:
    rows = [Guarded(wish, tank, 100.0, 0.1) for wish in ("a", "b", "c") for tank in (1.0, 2.0, None)]
    figure = draw_policy(rows, {"tank": (TIME, TIME, TIME), "none": (TIME, TIME, 9 * TIME)}, 1.0, "here")
    (_, _, peak, off) = figure.axes
    assert [label.get_text() for label in peak.get_xticklabels()] == ["1", "2", "none"]
    assert [text.get_text() for text in off.get_legend().get_texts()] == ["a", "b", "c"]
    plt.close(figure)


def test_hands_have_a_curve_and_a_closed_form_for_each_wall() -> None:
    walls = {"soft": 100.0, "hand": 500.0, "hard": 900.0}
    rows = [Pressed(wall, v, v * k) for wall, k in walls.items() for v in (0.1, 0.2)]
    figure = draw_hands(
        rows, walls, [Pressed("hand", 0.1, 50.0)], np.array([[0.1, 1], [60, 200]]), 0.16, "here"
    )
    over_speed, over_tank = figure.axes
    assert [text.get_text() for text in over_speed.get_legend().get_texts()] == [*walls, "v √(kΛ)"]
    assert "hand" in over_tank.get_title()
    plt.close(figure)


def test_walls_are_points_and_shares_have_intervals() -> None:
    decades = [
        Decade(f"1e{k} to 1e{k + 1} N/m", [share_of("", 3, 4, 0.95), share_of("", 4, 4, 0.95)])
        for k in (3, 4)
    ]
    figure = draw_walls(
        np.array([1e3, 1e4]), np.array([-0.1, -0.2]), np.array([50.0, 90.0]), decades, (140, 280), ""
    )
    each, shares, *_ = figure.axes
    assert each.collections[0].get_offsets().shape == (2, 2)
    assert [text.get_text() for text in shares.get_legend().get_texts()] == ["below 140 N", "below 280 N"]
    plt.close(figure)
