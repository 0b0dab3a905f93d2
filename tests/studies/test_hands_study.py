"""The study of a hand in the way: its closed forms, and what its page says of speeds and tanks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from passiflex.simulation import simulate
from passiflex.studies.contact import approach
from passiflex.studies.hands import (
    APPROACHES,
    ATTACKS,
    ENERGIES,
    HAND,
    LIMITS,
    WALLS,
    attack,
    bound,
    enough,
    moving_mass,
    speed_for,
    touch,
)


def test_an_energy_and_the_force_that_it_can_press_with_are_each_others_inverse() -> None:
    assert bound(HAND, enough(HAND, 140)) == pytest.approx(140)
    assert enough(HAND, 140) == pytest.approx(0.1307, abs=1e-4)


def test_a_speed_is_read_between_those_that_were_tried() -> None:
    assert speed_for(150, np.array([0.1, 0.2]), np.array([100, 200])) == pytest.approx(0.15)
    assert speed_for(300, np.array([0.1, 0.2]), np.array([100, 200])) == np.inf


def test_a_tank_with_little_energy_presses_a_hand_with_less_than_it_could() -> None:
    found = touch(simulate(attack("a step of 40 cm", HAND, enough(HAND, 280))))
    assert found.verdict == "passive"
    assert 100 < found.peak < 280


@pytest.mark.slow
@pytest.mark.parametrize("wall", [1e4, 3e4, HAND, 2e5, 1e6])
def test_the_bound_holds_against_other_references_and_stiffnesses(wall: float) -> None:
    """Those of the study, a stiffness that jumps in flight, and steps to and fro: three quarters at most."""
    harder = {"at": 0.4, "duration": 0, "stiffness": {"translation": 1500, "rotation": 30}}
    changes: list[dict[str, Any]] = [
        *ATTACKS.values(),
        {**ATTACKS["a step of 40 cm"], "gain_changes": [harder]},
        {"reference": [{"at": t, "kind": "step", "by": [0, 0, z]} for t, z in ((0.2, -0.2), (0.5, 0.2), (0.8, -0.3))]},
    ]  # fmt: skip
    for energy in (*ENERGIES, *(enough(wall, limit) for limit in LIMITS)):
        for change in changes:
            found = touch(simulate(attack("a step of 20 cm", wall, energy).changed(change)))
            assert found.verdict == "passive"
            assert found.peak < 0.75 * bound(wall, energy)


@pytest.mark.slow
@pytest.mark.parametrize("wall", WALLS)
def test_the_links_mass_says_how_hard_a_fast_hand_hits(wall: float) -> None:
    """Within 12 % from where the blow is more than what the hand presses with afterwards."""
    for speed in APPROACHES:
        found = touch(simulate(approach("recommended", wall, speed)))
        blow = found.speed * np.sqrt(wall * moving_mass())
        if blow > 60:
            assert found.peak == pytest.approx(blow, rel=0.12)
