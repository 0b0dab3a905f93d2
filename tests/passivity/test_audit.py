"""The verdict on a run: passive, violated or inconclusive, when, by what, and how sure."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from passiflex.errors import RunFileError
from passiflex.passivity import (
    Balance,
    audit,
    available_energy,
    claimed_balance,
    link_balance,
    port_tank,
    robot_balance,
)
from passiflex.simulation import Run, parse_scenario, simulate
from passiflex.studies import shipped_scenario
from worlds import by_rows, planar_text

PLANAR = planar_text(reference=None, duration=1)

RIGID = """\
name: rigid
robot: iiwa14
posture: [0, 0.6, 0, -1.2, 0, 1, 0]
law:
  type: rigid
  task: position
  gravity: robot
  stiffness: {translation: 1e4}
  damping: {translation: 20}
  target_inertia: {translation: 3.4}
duration: 1
output_interval: 0.01
"""

STEP = [{"at": 0.2, "kind": "step", "by": [0, 0, 0.05]}]
STEPS = 1e4


def run(text: str, **changes: Any) -> Run:
    return simulate(parse_scenario(yaml.safe_dump(yaml.safe_load(text) | changes)))


@lru_cache
def at_rest() -> Run:
    """Return an arm that never moves, with a tank of 2 J: its margin is 2 J at all times."""
    return run(PLANAR)


@lru_cache
def moving() -> Run:
    return run(PLANAR, reference=STEP)


@lru_cache
def fig3() -> Run:
    """Return Fig. 3 with its step at 0.5 s, and no push: wrong model, noise."""
    scenario = shipped_scenario("fig3")
    step = scenario.reference[0].model_copy(update={"at": 0.5})
    return simulate(scenario.model_copy(update={"duration": 2.0, "reference": (step,), "forces": ()}))


def with_energy(original: Run, **added: Any) -> Run:
    """Return a run with energy added to some of its signals, one number or one per row; its rows are all there is."""
    data = by_rows(original).data.copy(deep=True)
    for name, energy in added.items():
        signal = f"{name}_energy" if f"{name}_energy" in data else name
        data[signal] = data[signal].copy(data=data[signal].to_numpy() + energy)
    return Run(data)


# Balances


def test_the_residual_is_what_is_left_over() -> None:
    """H − H(0) − supplied + dissipated: of 5 J in and 2 J lost, 3 J must be stored; 4 J are, so 1 J is wrong."""
    balance = Balance(
        "hand-made",
        storages={"spring": np.array([1.0, 2.0, 4.0]), "mass": np.array([0.0, 1.0, 1.0])},
        supplied={"hand": np.array([0.0, 2.0, 6.0]), "wind": np.array([0.0, 0.0, -1.0])},
        dissipated={"damper": np.array([0.0, 0.5, 2.0])},
    )
    np.testing.assert_array_equal(balance.total, [1, 3, 5])
    np.testing.assert_array_equal(balance.residual, [0, 0.5, 1])
    assert balance.worst == 1


def test_the_worst_residual_counts_whatever_its_sign() -> None:
    zero = np.zeros(2)
    balance = Balance("lossy", {"spring": np.array([3.0, 1.0])}, {"hand": zero}, {"damper": zero})
    assert balance.worst == 2


def test_a_balance_does_not_depend_on_the_level_of_a_storage() -> None:
    """Potential energies have no zero of their own."""
    lifted = with_energy(moving(), potential=100.0)
    np.testing.assert_allclose(link_balance(lifted).residual, link_balance(moving()).residual, atol=1e-12)


@pytest.mark.parametrize(
    ("balance", "signal", "sign"),
    [
        (robot_balance, "external", -1),
        (robot_balance, "motor", -1),
        (robot_balance, "joint_loss", 1),
        (robot_balance, "link_kinetic", 1),
        (robot_balance, "joint_spring", 1),
        (link_balance, "external", -1),
        (link_balance, "joint", -1),
        (link_balance, "link_kinetic", 1),
        (claimed_balance, "external", -1),
        (claimed_balance, "reference", -1),
        (claimed_balance, "drawn", 1),
        (claimed_balance, "spilled", 1),
        (claimed_balance, "tank", 1),
        (claimed_balance, "cartesian_spring", 1),
        (claimed_balance, "shaped_kinetic", 1),
    ],
)
def test_every_joule_is_seen_with_its_sign(balance: Any, signal: str, sign: int) -> None:
    """One joule more in a port, a loss or a storage is one joule in the residual."""
    late = np.where(moving().time > 0.5, 1.0, 0.0)
    changed = balance(with_energy(moving(), **{signal: late})).residual - balance(moving()).residual
    np.testing.assert_allclose(changed, sign * late, rtol=0, atol=1e-12)


# Verdicts on real runs


def test_fig_1_is_passive_and_its_books_close() -> None:
    """The law's model is right: what its books miss is the integrator's, 1e4 steps of 1e-9 of 2 J at most."""
    result = audit(simulate(shipped_scenario("fig1")))
    assert result.verdict == "passive"
    assert result.margin > 0
    assert result.overdraft == 0
    assert result.remedy == "none needed"
    # The tank had 2 J; the links take what the spring's 0.3 J give them, and no more.
    assert 2 - 0.3 < result.margin < 2
    # The least margin is when the links are fastest, within half a second of the step at 10 s.
    assert 10 < result.time < 10.5
    assert result.term == "moving reference"
    for error in (result.books_error, result.integration_error, result.ledger_residual):
        assert error < 1e-6


def test_fig_3_is_passive_at_the_port_though_its_books_are_wrong() -> None:
    """A wrong model and noise: the law's own books miss 0.4 J, and the links took less than they could."""
    result = audit(fig3())
    assert result.verdict == "passive"
    assert result.margin > 1
    assert result.books_error > 10 * result.integration_error
    assert result.books_error > 0.1
    assert result.integration_error < 1e-5


def test_a_law_that_ignores_the_elasticity_is_violated() -> None:
    """The rigid law at 1e4 N/m excites the joints: it gives the links 2 J more than the moving reference brought."""
    result = audit(run(RIGID, reference=STEP))
    assert result.verdict == "violated"
    assert result.margin < -1
    assert result.overdraft == -result.margin
    assert 0.2 < result.time < 0.4
    # There is neither a tank nor a wrong model.
    assert result.remedy == "take a larger target_inertia, lower the gains or take the impedance law"
    # It is no matter of integration: the links' balance closes a million times better.
    assert result.integration_error < 1e-6 * result.overdraft


def test_a_run_with_an_absurd_model_is_not_passive() -> None:
    """Links believed 51 times as heavy: the motors push them beyond what was stored, or out of the numbers."""
    law = yaml.safe_load(RIGID)["law"] | {
        "damping": {"translation": 200},
        "target_inertia": {"translation": 0.1},
        "motor_inertia": "carried",
    }
    result = audit(run(RIGID, law=law, model_errors={"link_inertia": 50}, reference=STEP, duration=3))
    assert result.verdict == "violated"
    assert result.term == "inertia shaped by the law and model error"
    assert "lower the gains, correct the law's model or take the impedance law" in result.remedy


def test_an_arm_that_sags_is_not_active() -> None:
    """Static compensation by half of the weight: the arm falls, and falling gives nothing to anyone."""
    scenario = shipped_scenario("fig3")
    law = scenario.law.model_copy(update={"gravity": "static"})
    changes = {"law": law, "duration": 3.0, "reference": (), "forces": (), "noise": None}
    sagging = simulate(scenario.model_copy(update=changes))
    assert sagging["position"][-1, 2] - sagging["position"][0, 2] < -0.3
    result = audit(sagging)
    assert result.verdict == "passive"
    assert result.margin > 0


# Verdicts on energy that is added


def test_an_arm_at_rest_keeps_its_whole_budget() -> None:
    result = audit(at_rest())
    assert result.verdict == "passive"
    assert result.margin == pytest.approx(2, abs=1e-12)


def test_an_arm_at_rest_with_an_empty_budget_is_passive() -> None:
    """It has nothing and gives nothing: round-off is no overdraft."""
    result = audit(run(RIGID, duration=0.1))
    assert result.verdict == "passive"
    assert abs(result.margin) < 1e-13


def test_an_overdraft_is_found_when_it_happens() -> None:
    """4 W into links that may take 2 J: overdrawn after 0.5 s, by 2 J after 1 s."""
    energy = 4 * at_rest().time
    active = with_energy(at_rest(), joint=energy, link_kinetic=energy)
    result = audit(active)
    assert result.verdict == "violated"
    assert result.time == pytest.approx(0.51, abs=1e-9)  # the first row after 0.5 s
    assert result.margin == pytest.approx(-2, abs=1e-9)
    assert result.overdraft == pytest.approx(2, abs=1e-9)
    np.testing.assert_allclose(available_energy(active), 2 - energy, rtol=0, atol=1e-9)
    np.testing.assert_allclose(port_tank(active), 2 - energy, rtol=0, atol=1e-9)


def test_an_overdraft_that_is_given_back_was_one() -> None:
    """Passivity is asked for at every instant, not at the end."""
    energy = np.where(np.abs(at_rest().time - 0.5) < 0.1, 3.0, 0.0)
    result = audit(with_energy(at_rest(), joint=energy, link_kinetic=energy))
    assert result.verdict == "violated"
    assert result.time == pytest.approx(0.41, abs=0.011)


def test_what_the_environment_gives_is_no_overdraft() -> None:
    """A push fills the links without a joule through the joints."""
    energy = 4 * at_rest().time
    result = audit(with_energy(at_rest(), external=energy, link_kinetic=energy))
    assert result.verdict == "passive"
    assert result.margin == pytest.approx(2, abs=1e-9)


ENERGY = 5.0
DRAINS: dict[str, dict[str, float]] = {
    "motion of the links": {"link_kinetic": 1, "tank": -1},
    "work on the environment": {"external": -1, "tank": -1},
    "the law's own books": {"link_kinetic": 1, "tank": 1},
    "moving reference": {"link_kinetic": 0.5, "external": -0.5, "reference": 1},
}
"""Where 1 J through the joints goes; the books of the links always close, the law's but for what they miss."""


@pytest.mark.parametrize("term", DRAINS)
def test_the_verdict_names_what_took_most(term: str) -> None:
    energy = ENERGY * at_rest().time
    changes = {name: share * energy for name, share in DRAINS[term].items()}
    changed = with_energy(at_rest(), joint=energy, **changes)
    result = audit(changed)
    assert result.term == term
    assert result.verdict == "violated"
    assert link_balance(changed).worst < 1e-9


def test_a_margin_below_zero_within_the_integration_error_is_inconclusive() -> None:
    """Overdrawn by 1 mJ, and the links' balance is wrong by 10 mJ: nobody knows."""
    energy = 2.001 * at_rest().time
    result = audit(with_energy(at_rest(), joint=energy, link_kinetic=energy + 0.01 * at_rest().time))
    assert result.verdict == "inconclusive"
    assert result.integration_error == pytest.approx(0.01, rel=1e-6)
    assert result.margin == pytest.approx(-1e-3, rel=1e-6)
    assert result.time == pytest.approx(1)
    assert result.remedy == "the margin is below the integration error: lower the tolerance"


def test_a_margin_above_zero_within_the_integration_error_is_inconclusive() -> None:
    """1 mJ left, and the links' balance is wrong by 10 mJ: nobody knows."""
    energy = 1.999 * at_rest().time
    result = audit(with_energy(at_rest(), joint=energy, link_kinetic=energy + 0.01 * at_rest().time))
    assert result.margin == pytest.approx(1e-3, rel=1e-6)
    assert result.verdict == "inconclusive"


def test_a_margin_beyond_the_integration_error_is_conclusive() -> None:
    energy = 2.1 * at_rest().time
    result = audit(with_energy(at_rest(), joint=energy, link_kinetic=energy + 0.01 * at_rest().time))
    assert result.verdict == "violated"


def test_a_run_that_ended_early_is_inconclusive() -> None:
    """What it would have done next is unknown; what it did is not."""
    early = Run(moving().data.assign_attrs(failure="the integrator gave up"))
    result = audit(early)
    assert result.verdict == "inconclusive"
    assert result.remedy == "the run ended early: the integrator gave up"
    energy = 10 * early.time
    worse = audit(with_energy(early, joint=energy, link_kinetic=energy))
    assert worse.verdict == "violated"


def test_a_law_without_a_tank_may_give_what_the_reference_brought() -> None:
    """The same energies: lent to the rigid law, but paid from the tank by a law that has one."""
    rigid = run(RIGID, duration=0.1)
    energy = 3 * rigid.time / rigid.time[-1]
    assert audit(with_energy(rigid, joint=energy, link_kinetic=energy)).verdict == "violated"
    lent = with_energy(rigid, joint=energy, link_kinetic=energy, reference=energy)
    assert audit(lent).verdict == "passive"
    paid = with_energy(
        at_rest(), joint=3.0 * at_rest().time, link_kinetic=3.0 * at_rest().time, reference=3.0
    )
    assert audit(paid).verdict == "violated"


def test_the_stored_energy_may_be_given_too() -> None:
    """5 J in the shaped springs at the start: 6 of 2 + 5 J may leave, 8 may not."""
    time = at_rest().time
    for given, verdict in ((6.0, "passive"), (8.0, "violated")):
        energy = given * time
        loaded = with_energy(at_rest(), shaped_spring=5 * (1 - time), joint=energy, link_kinetic=energy)
        assert audit(loaded).verdict == verdict


def test_lifting_the_weight_that_the_law_carries_is_free() -> None:
    """V̂ rises by what the joints give: the compensation's storage pays, not the tank."""
    energy = 50 * at_rest().time
    lifted = with_energy(
        at_rest(), joint=energy, potential=energy, compensated=energy, gravity_storage=-energy
    )
    assert audit(lifted).margin == pytest.approx(2, abs=1e-9)


def test_the_balances_come_with_the_verdict() -> None:
    result = audit(moving())
    assert [b.name for b in result.balances] == ["robot", "links", "law"]
    robot, links, law = result.balances
    assert robot.worst == result.ledger_residual
    # The errors are those of all steps, of which the rows are some.
    assert links.worst <= result.integration_error < 10 * links.worst
    assert law.worst <= result.books_error < 10 * law.worst


@pytest.mark.parametrize(
    "signal", ["joint_energy", "link_kinetic_energy", "external_energy", "compensated_energy"]
)
def test_a_number_that_is_none_is_never_passive(signal: str, tmp_path: Path) -> None:
    """Every comparison with NaN is false; neither the verdict nor the file may fall through that."""
    broken = with_energy(moving(), **{signal: np.where(moving().time > 0.5, np.nan, 0.0)})
    assert audit(broken).verdict == "inconclusive"
    broken.save(tmp_path / "run.nc")
    with pytest.raises(RunFileError, match=f"numbers that are not finite; got in .*{signal}"):
        Run.load(tmp_path / "run.nc")


def test_the_power_of_every_flow_is_the_slope_of_its_energy() -> None:
    """Between two rows the energy grows by the mean power there, to the second order of their distance."""
    original = moving()
    step = np.diff(original.time)
    for balance in (robot_balance(original), link_balance(original), claimed_balance(original)):
        assert set(balance.supplied_power) == set(balance.supplied)
        assert set(balance.dissipated_power) == set(balance.dissipated)
        for energies, powers in (
            (balance.supplied, balance.supplied_power),
            (balance.dissipated, balance.dissipated_power),
        ):
            for name, energy in energies.items():
                mean = (powers[name][1:] + powers[name][:-1]) / 2
                curvature = np.abs(np.diff(powers[name], 2)).max(initial=0.0) + 1e-9
                smooth = np.abs(np.diff(energy) - mean * step)
                assert np.quantile(smooth, 0.9) <= curvature * step.max(), name
