"""The study of a load that the law does not know: its books, and what its page says."""

from __future__ import annotations

import numpy as np
import pytest

from passiflex.passivity import environment_balance
from passiflex.simulation import Run, simulate
from passiflex.studies.grip import GRAVITY, HEAVIEST, MASS, WAYS, Grip, grip, gripped, holds, read_mass

UNKNOWN, KNOWN, POOR = WAYS


def ran(way: str) -> tuple[Run, Grip]:
    run = simulate(grip(way))
    return run, gripped(run, read_mass(run))


@pytest.mark.slow
def test_a_load_sags_by_its_weight_over_the_springs_and_its_lift_is_paid_by_the_tank() -> None:
    run, found = ran(UNKNOWN)
    assert found.verdict == "passive"
    assert found.sag == pytest.approx(found.foreseen, rel=0.01)
    assert found.read == pytest.approx(MASS, rel=0.03)
    assert found.stored == pytest.approx(found.drawn, abs=0.05)
    assert run["load_storage"][-1] == pytest.approx(found.stored, abs=0.03)
    assert environment_balance(run).worst < 1e-3


@pytest.mark.slow
def test_what_the_page_says_of_a_load() -> None:
    found = {way: ran(way)[1] for way in WAYS}
    assert all(one.verdict == "passive" for one in found.values())
    assert found[KNOWN].sag < 2e-3
    assert found[KNOWN].read == pytest.approx(MASS, rel=0.03)
    assert found[KNOWN].drawn == pytest.approx(MASS * GRAVITY * 0.2, rel=0.03)
    assert found[UNKNOWN].dip < 1.15 * found[UNKNOWN].sag
    assert found[POOR].held_back > 1
    assert 0.05 < found[POOR].raised < 0.1
    assert found[POOR].drawn < 1.9


@pytest.mark.slow
def test_the_law_makes_nothing_of_the_external_torque_here() -> None:
    """With K_e = K the law has no use for it: bit for bit the same, whoever reads it."""
    asked = grip(UNKNOWN)
    runs = [
        simulate(asked.changed({"control.external_torque": how})) for how in ("none", "measured", "observer")
    ]
    for other in runs[1:]:
        assert np.array_equal(runs[0]["position"], other["position"])


@pytest.mark.slow
@pytest.mark.parametrize("mass", [0, MASS, HEAVIEST])
def test_the_gains_hold_with_any_load_that_the_arm_carries(mass: float) -> None:
    assert holds(mass)


@pytest.mark.slow
@pytest.mark.parametrize("mass", [0.5, 5, HEAVIEST])
def test_a_load_of_any_mass_comes_to_rest_where_its_weight_is_held(mass: float) -> None:
    """Joints and hand move far under the heaviest, so that the closed form of the start is right to 10 %."""
    asked = grip(UNKNOWN).changed({"environment[0].mass": mass, "reference": [], "tank.initial": 20})
    run = simulate(asked)
    found = gripped(run, read_mass(run))
    assert found.verdict == "passive"
    assert found.sag == pytest.approx(found.foreseen * mass / MASS, rel=0.1)
