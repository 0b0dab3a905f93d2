"""The study of polishing: its scenario, its closed form, and what its page says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from passiflex.passivity import environment_balance
from passiflex.simulation import resolve, simulate
from passiflex.studies.gliding import DOME, FLOOR, GAP, HAND, SPEED, TANK, Carried, carried, steady
from passiflex.studies.paper import shipped_scenario
from passiflex.studies.polishing import FORCES, FRICTIONS, endless, fed_forward, lag, polished, polishing

MASSLESS = Carried(np.zeros((3, 3)), np.zeros((3, 3)))


def test_the_shipped_scenario_is_one_of_the_studys() -> None:
    """To the rounding of what is written there."""
    shipped, ours = shipped_scenario("polishing"), polishing(10, 0.4)
    assert shipped.environment[0].centre == pytest.approx(ours.environment[0].centre, abs=1e-6)
    for mine, its in zip(ours.reference, shipped.reference, strict=True):
        for name in ("at", "by", "radius", "period"):
            if hasattr(mine, name):
                assert getattr(its, name) == pytest.approx(getattr(mine, name), abs=1e-4)


def test_the_hand_starts_off_the_dome_and_the_reference_goes_round_within_it() -> None:
    scenario = polishing(20, 0.2)
    problem = resolve(scenario)
    centre = problem.home.position + np.array(scenario.environment[0].centre)
    assert np.linalg.norm(problem.home.position - centre) == pytest.approx(DOME + HAND + GAP)
    circle = problem.events[-1].motion
    assert circle is not None
    deep = 20 * (1 / 1000 + 1 / 1e4)
    for turn in np.linspace(0, 1, 7):
        angle = 2 * math.pi * turn
        place = (
            circle["polynomial"][:, 0]
            + circle["sine"] * math.sin(angle)
            + circle["cosine"] * (1 - math.cos(angle))
        )
        assert np.linalg.norm(place - centre) == pytest.approx(DOME + HAND - deep, rel=1e-9)


def test_a_hand_that_hardly_glides_presses_as_wanted() -> None:
    """Without inertia and softness of the joints; what it lags is what the damping takes."""
    closed = steady(10, 1e-9, MASSLESS)
    assert closed.force == pytest.approx(10, rel=0.05)
    assert closed.lag == pytest.approx(
        80 * SPEED / 1000, rel=0.07
    )  # the hand is farther out than the reference
    assert closed.power == pytest.approx(1e-9 * closed.force * SPEED, rel=0.05)


@pytest.mark.slow
def test_friction_empties_the_tank_as_foreseen_and_the_hand_stays_pressed() -> None:
    """At the shortest run of the study; the tank pays for the way, and the spring for the press."""
    run = simulate(polishing(20, 0.6))
    found, closed = polished(run, 0.6), steady(20, 0.6, carried(polishing(20, 0.6)))
    assert found.verdict == "passive"
    assert found.force == pytest.approx(closed.force, rel=0.02)
    assert found.lag == pytest.approx(closed.lag, rel=0.05)
    assert found.lost == pytest.approx(found.rubbed, rel=0.05)
    assert found.given <= TANK
    assert found.rest == pytest.approx(20, rel=0.1)
    assert abs(lag(run)).max() > 5 * found.lag
    assert environment_balance(run).worst < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("force", FORCES)
def test_what_the_page_says_of_polishing(force: float, friction: float) -> None:
    """Press within 0.3 N and lag within 1 mm of the closed form; the way that the tank pays for within 12 %."""
    scenario = polishing(force, friction)
    found, closed = polished(simulate(scenario), friction), steady(force, friction, carried(scenario))
    assert found.verdict == "passive"
    assert abs(found.force - closed.force) < 0.3
    assert abs(found.lag - closed.lag) < 1e-3
    assert abs(found.lasts - closed.lasts) < 1.5
    assert found.lost < TANK - FLOOR
    paid = (TANK - FLOOR) / (friction * found.force)
    assert 0.88 * paid < found.way < 1.02 * paid
    assert found.lost == pytest.approx(found.rubbed, rel=0.05)
    assert found.force < found.rest < 1.5 * force


@pytest.mark.slow
def test_a_tank_changes_nothing_while_it_lasts_and_a_valve_lets_the_press_go() -> None:
    guarded, free = simulate(polishing(10, 0.4)), simulate(endless(10, 0.4))
    while_it_lasts = guarded.time < polished(guarded, 0.4).lasts
    assert np.array_equal(guarded["position"][while_it_lasts], free["position"][while_it_lasts])
    assert polished(free, 0.4).given > TANK + 1
    assert polished(simulate(fed_forward(10, 0.4)), 0.4).rest < 4
