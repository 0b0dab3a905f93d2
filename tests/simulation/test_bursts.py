"""Bursts of lost periods: the law stands still in just these, alone and in lanes."""

from __future__ import annotations

import numpy as np
import pytest

import passiflex as pf
from passiflex.errors import PassiflexError, ScenarioError
from passiflex.passivity import audit
from passiflex.simulation import parse_scenario, resolve
from passiflex.simulation.batch import simulate_in_lane
from worlds import world

BURSTS = [{"at": 0.2, "periods": 15}, {"at": 0.3005, "periods": 2}]
"""At 1 kHz periods 200 to 214, and the first two at or after 0.3005 s: 301 and 302."""


def test_the_law_stands_still_in_a_burst_and_nowhere_else() -> None:
    run = pf.simulate(world(control={"lost": BURSTS}))
    changed = np.abs(np.diff(run["read_time"])) > 0
    still = np.flatnonzero(~changed) + 1
    assert still.tolist() == [*range(200, 215), 301, 302]
    assert not np.diff(run["tau_m"], axis=0)[still - 1].any()
    assert audit(run).verdict == "passive"


def test_it_is_the_same_in_lanes() -> None:
    problem = resolve(world(control={"lost": BURSTS, "missed": 0.1}, noise={"torque_variance": 0.01}))
    alone, lane = (
        pf.simulate(world(control={"lost": BURSTS, "missed": 0.1}, noise={"torque_variance": 0.01})),
        None,
    )
    lane = simulate_in_lane(problem)
    np.testing.assert_allclose(lane["q"], alone["q"], atol=1e-9)
    np.testing.assert_array_equal(lane["read_time"], alone["read_time"])


def test_bursts_change_nothing_about_chance() -> None:
    free, lost = (
        pf.simulate(world(noise={"torque_variance": 0.01}, control={"lost": lost})) for lost in ([], BURSTS)
    )
    before = free.time < 0.2
    np.testing.assert_array_equal(free["measured_tau_a"][before], lost["measured_tau_a"][before])


def test_a_scenario_with_bursts_is_written_whole() -> None:
    scenario = world(control={"lost": BURSTS})
    assert parse_scenario(scenario.to_yaml()) == scenario


@pytest.mark.parametrize(
    ("burst", "said"), [({"at": -1, "periods": 1}, "at"), ({"at": 1, "periods": 0}, "periods")]
)
def test_a_burst_that_is_none_is_refused(burst: dict[str, float], said: str) -> None:
    with pytest.raises(PassiflexError, match=said):
        world(control={"lost": [burst]})


def test_a_burst_after_the_end_is_refused() -> None:
    with pytest.raises(
        ScenarioError, match=r"control.lost\[1\].at: needs to be earlier than the end, 0.4 s; got 3 s"
    ):
        world(control={"lost": [*BURSTS[:1], {"at": 3, "periods": 2}]}, duration=0.4)
