"""Two rates, late sensors, long delays and bursts, where they meet each other and what asks about clocks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import passiflex as pf
from passiflex.limits import limit_map, recommend_for
from passiflex.limits.confirmation import disturbed
from passiflex.metrics.steps import step_window
from passiflex.passivity import audit
from passiflex.reports.facts import facts
from passiflex.simulation import resolve
from passiflex.simulation.cautions import cautions
from worlds import PERIOD, ran, world

SLOW: dict[str, Any] = {"task_rate": 200}


@pytest.mark.parametrize(
    ("control", "why"), [(SLOW, "with task_rate take plain"), ({"delay": 0.021}, "at most 20 periods")]
)
def test_a_recommendation_leaves_out_the_inner_loop_that_it_does_not_go_with(
    control: dict[str, Any], why: str
) -> None:
    soft = {"stiffness": {"translation": 50}, "damping": {"translation": 15}}
    found = recommend_for(world(control=control, law=soft), margin=0.0)
    assert found.inner_loop == "plain"
    assert "the matched inner loop is none here: " in found.other
    assert why in found.other


def test_a_limit_map_scans_rates_with_as_many_periods_of_everything() -> None:
    """Of sensors that are late too, so that theory and simulation are asked about one loop.

    What changes by 1e-5 in a period changes by 2 % in the 2000 that are simulated, which is not seen.
    """
    late = world(sensors={"torque_delay": 1e-3}, control=SLOW, law={"shaped_inertia": {"ratio": 1}})
    found = limit_map(late)
    assert all(p.agrees for p in found.confirmations if abs(p.radius - 1) > 1e-5)
    told = "with as many periods that the sensors are late and a task_rate of a 5th of it"
    assert found.admissible.borders.endswith(told)


def test_a_tank_that_brakes_does_so_in_every_period() -> None:
    """Held for a cycle, its damping of 200 N m s/rad would be what destroys the arm."""
    tank = {"kind": "time_domain", "initial": 0.011, "braking": 200}
    soft = {"damping": {"translation": 15}}
    margins = [audit(ran(tank=tank, law=soft, control={"task_rate": rate})).margin for rate in (1000, 100)]
    assert margins[1] > 10 * margins[0]


def test_a_burst_is_a_missed_period_to_what_is_said_and_none_to_a_confirmation() -> None:
    problem = resolve(world(sensors={"link_delay": 2e-3}, control={"lost": [{"at": 0.2, "periods": 5}]}))
    assert any("with periods missed as well" in line for line in cautions(problem))
    assert disturbed(problem).lost == ()


def test_rows_of_a_wrench_that_say_the_same_end_no_step() -> None:
    """Its step is looked at until the wrench changes; where it changes from row to row there is none to look at."""
    time = np.arange(600) * PERIOD
    window = step_window(world(forces=[{"rows": pf.wrench_table(time, np.zeros((600, 3))).rows}]))
    assert window is not None
    assert window.end == 0.6
    push = np.column_stack([0.1 * np.sin(np.arange(600)), *np.zeros((2, 600))])
    assert step_window(world(forces=[{"rows": pf.wrench_table(time, push).rows}])) is None


def test_a_report_says_both_rates() -> None:
    run = ran(control=SLOW)
    assert any("the task at 200 Hz" in str(value) for _, value in facts(run, run.scenario))
