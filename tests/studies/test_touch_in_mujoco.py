"""The studies of touch in the other engine: what their pages say of it."""

from __future__ import annotations

import pytest

from passiflex.passivity import audit
from passiflex.simulation import Run, Scenario, resolve, simulate_problem
from passiflex.studies.grip import grip, gripped, read_mass
from passiflex.studies.hands import HAND, attack, enough, touch
from passiflex.studies.policy import WILD, obeyed, told
from passiflex.studies.polishing import polished, polishing

pytest.importorskip("mujoco")


def both(scenario: Scenario) -> tuple[Run, Run]:
    ours, its = (simulate_problem(resolve(scenario), engine) for engine in ("passiflex", "mujoco"))
    assert audit(ours).verdict == audit(its).verdict == "passive"
    return ours, its


@pytest.mark.slow
@pytest.mark.parametrize("limit", [140, 280])
def test_a_hand_in_the_way_feels_the_same(limit: float) -> None:
    ours, its = (touch(run) for run in both(attack("a step of 40 cm", HAND, enough(HAND, limit))))
    assert its.peak == pytest.approx(ours.peak, rel=1e-4)
    assert its.speed == pytest.approx(ours.speed, rel=1e-4)


@pytest.mark.slow
def test_a_load_sags_as_far_and_costs_as_much() -> None:
    ours, its = (gripped(run, read_mass(run)) for run in both(grip("2 kg, unknown")))
    assert its.sag == pytest.approx(ours.sag, rel=1e-6)
    assert its.drawn == pytest.approx(ours.drawn, rel=1e-6)


@pytest.mark.slow
def test_a_dome_is_pressed_and_the_tank_lasts_as_long() -> None:
    """Friction is not the same model there: the hand creeps a little."""
    ours, its = (polished(run, 0.6) for run in both(polishing(20, 0.6)))
    assert its.force == pytest.approx(ours.force, rel=2e-3)
    assert its.lost == pytest.approx(ours.lost, rel=2e-3)
    assert its.lasts == pytest.approx(ours.lasts, abs=0.05)


@pytest.mark.slow
def test_a_policy_is_bounded_by_its_tank_there_too() -> None:
    """It bounces and rubs at once, so that the peak is the same to 6 % only."""
    ours, its = (obeyed(run) for run in both(told(WILD, 1.0, 0)))
    assert its.given < 1
    assert its.peak == pytest.approx(ours.peak, rel=0.06)
