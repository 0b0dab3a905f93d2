"""One control period against its law alone, to the last bit: what the tank lets through, and what it holds back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings

from loops import SEEDS
from passiflex.sampled.tanks import TimeDomainTank, VariableStiffnessTank
from sampled.periods import FULL, LEVELS, PERIOD, Rig, planar_rig, spatial_rig

OBSERVER, VARIABLE = TimeDomainTank(), VariableStiffnessTank()
RIGS = {"position": planar_rig, "pose": spatial_rig}
ON = {
    "follow_velocity": 0.7,
    "follow_acceleration": 0.9,
    "posture_stiffness": 40.0,
    "posture_damping": 3.0,
    "posture": 0.3,
}
STILL = {"velocity": np.zeros(6), "acceleration": np.zeros(6), "wrench": np.zeros(6)}
WRENCH = np.array([5.0, -3.0, 8.0, 0.4, 0.1, -0.2])
ACTIONS = {
    "wrench": ({}, STILL | {"wrench": WRENCH}),
    "velocity": ({"follow_velocity": 0.7}, {"wrench": np.zeros(6)}),
    "acceleration": ({"follow_acceleration": 0.9}, {"wrench": np.zeros(6)}),
    "posture": ({"posture_stiffness": 40.0}, STILL),
    "all": (ON, {"wrench": WRENCH}),
}
"""Name → (what is on, what the row holds)."""
ROUND = 1e-12

each_rig = pytest.mark.parametrize("make", RIGS.values(), ids=RIGS)


def two(rig: Rig, seed: int, **fixed: object) -> np.ndarray:
    """Return two rows: the first period books nothing, the second one does."""
    return rig.random(np.random.default_rng(seed), 2, **fixed)


@each_rig
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_with_a_full_tank_the_command_is_the_laws_to_the_last_bit(make: Callable[[], Rig], seed: int) -> None:
    """Whatever is measured and wanted, in the first period and later; the setpoint is in force at once."""
    rig = make()
    p, told = rig.numbers(seed % 100), two(rig, seed, wrench=np.zeros(6))
    out = rig.run(rig.start(rig.random(np.random.default_rng(seed + 1))[0], FULL), told, p)
    for i, row in enumerate(told):
        np.testing.assert_array_equal(out.command[i], rig.law_says(row, p).command)
        setpoint = rig.told.unpack(row)
        np.testing.assert_array_equal(out.governed_position[i], setpoint["position"])
        np.testing.assert_array_equal(out.governed_rotation[i], setpoint["rotation"])
        np.testing.assert_array_equal(out.held_stiffness[i], setpoint["stiffness"])
    for share in (out.entry_reference_share, out.entry_stiffness_share, out.entry_valve):
        np.testing.assert_array_equal(share, 1)
    assert not np.any([out.governed_time, out.latched, out.faults])


@each_rig
@pytest.mark.parametrize("name", ACTIONS)
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS)
def test_with_a_full_tank_an_action_is_added_ungated(make: Callable[[], Rig], name: str, seed: int) -> None:
    rig, (on, row) = make(), ACTIONS[name]
    p, told = rig.numbers(seed % 100, on), two(rig, seed, **row)
    out = rig.run(rig.start(told[0], FULL), told, p)
    for i, row in enumerate(told):
        torque = np.array(rig.actions(row, p)).ravel()
        assert torque.any()
        np.testing.assert_array_equal(out.command[i], rig.law_says(row, p, torque).command)


@each_rig
@pytest.mark.parametrize("name", ACTIONS)
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS)
def test_with_the_valve_shut_actions_vanish(make: Callable[[], Rig], name: str, seed: int) -> None:
    """To the last bit, at the floor and below; the valve is that of this period's level."""
    rig, (on, row) = make(), ACTIONS[name]
    p, told = rig.numbers(seed % 100, on), rig.random(np.random.default_rng(seed), 1, **row)
    for level in (LEVELS["floor"], 0.0, -3.0):
        out = rig.run(rig.start(told[0], level), told, p)
        assert (out.entry_valve, out.entry_level) == (0, level)
        np.testing.assert_array_equal(out.command[0], rig.law_says(told[0], p).command)


@each_rig
@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_a_half_open_valve_lets_its_share_through(make: Callable[[], Rig], seed: int) -> None:
    rig = make()
    p, told = rig.numbers(seed % 100, ON), rig.random(np.random.default_rng(seed), 1, wrench=WRENCH)
    share = np.random.default_rng(seed).uniform(0.05, 0.95)
    out = rig.run(rig.start(told[0], 0.1 + 0.2 * share), told, p)
    beta = share**2 * (3 - 2 * share)
    assert out.entry_valve[0] == pytest.approx(beta, rel=ROUND)
    torque = beta * np.array(rig.actions(told[0], p)).ravel()
    expected = rig.law_says(told[0], p, torque).command
    np.testing.assert_allclose(out.command[0], expected, rtol=0, atol=ROUND * np.abs(expected).max() * 10)


def slack(rig: Rig, seed: int, count: int, p: np.ndarray, **fixed: object) -> tuple[np.ndarray, np.ndarray]:
    """Return the same measurement `count` times with a far reference, and the row whose spring is slack."""
    (row,) = rig.random(np.random.default_rng(seed), **fixed)
    here = rig.law_says(row, p)
    home = rig.but(row, position=here.position, rotation=here.rotation)
    return np.tile(row, (count, 1)), home


@each_rig
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_a_poor_tank_holds_the_reference_back_and_never_passes_its_floor(
    make: Callable[[], Rig], seed: int
) -> None:
    """From a slack spring, nothing moving: what the spring stores is what the tank loses, down to the floor."""
    rig = make()
    p = rig.numbers(seed % 100)
    told, home = slack(rig, seed, 40, p)
    floor, level = LEVELS["floor"], LEVELS["floor"] + 0.5 * rig.law_says(told[0], p).potential
    out = rig.run(rig.start(home, level), told, p)
    assert (out.entry_reference_share < 1).all()
    assert (out.tank_energy >= floor - ROUND * level).all()
    stored = np.array([rig.law_says(governed(rig, row, out, i), p).potential for i, row in enumerate(told)])
    np.testing.assert_allclose(level - out.tank_energy, stored, rtol=0, atol=ROUND * 1e2 * stored.max())
    # The search leaves 1/4096 of the way at most: then all is spent but a little, and the reference stands.
    assert out.tank_energy[-1] - floor <= (level - floor) * 1e-3
    steps = np.abs(np.diff(out.governed_position, axis=0)).max(axis=1)
    assert steps[-1] <= 1e-3 * steps.max() + 1e-300
    np.testing.assert_allclose(out.governed_time, PERIOD * np.arange(1, 41), rtol=1e-12)
    np.testing.assert_array_equal(out.lowest_level, np.minimum.accumulate(out.tank_energy))


def governed(rig: Rig, row: np.ndarray, out: object, i: int) -> np.ndarray:
    """Return the row with what was granted as the setpoint."""
    names = {"position": "governed_position", "rotation": "governed_rotation", "stiffness": "held_stiffness"}
    return rig.but(row, **{name: getattr(out, field)[i] for name, field in names.items()})


@each_rig
@pytest.mark.parametrize("level", [LEVELS["floor"], 0.0, -1.0])
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS)
def test_an_empty_tank_stops_the_reference(make: Callable[[], Rig], level: float, seed: int) -> None:
    """It stands to the last bit, and the law commands toward it."""
    rig = make()
    p = rig.numbers(seed % 100)
    told, home = slack(rig, seed, 3, p)
    at_home = rig.told.unpack(home)
    out = rig.run(rig.start(home, level), told, p)
    for i, row in enumerate(told):
        np.testing.assert_array_equal(out.governed_position[i], at_home["position"])
        np.testing.assert_array_equal(out.governed_rotation[i], at_home["rotation"])
        assert out.entry_reference_share[i] == 0
        assert out.tank_energy[i] == level
        expected = rig.law_says(governed(rig, row, out, i), p).command
        np.testing.assert_array_equal(out.command[i], expected)


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_an_empty_tank_holds_the_stiffness_of_a_stretched_spring(seed: int) -> None:
    """More of it costs energy, less gives some back: the one waits, the other is in force at once."""
    rig = planar_rig()
    p, (row,) = rig.numbers(seed % 100), rig.random(np.random.default_rng(seed))
    K = rig.told.unpack(row)["stiffness"]
    for factor, share in ((2.0, 0), (0.5, 1)):
        out = rig.run(rig.start(row, 0.0), rig.but(row, stiffness=factor * K)[None], p)
        np.testing.assert_array_equal(out.held_stiffness[0], K * factor**share)
        assert out.entry_stiffness_share[0] == share
        gained = (1 - factor) * share * rig.law_says(row, p).potential
        assert out.tank_energy[0] == pytest.approx(gained, rel=1e-12)


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_stiffness_and_pose_share_one_budget(seed: int) -> None:
    """Twice the stiffness costs U; of what is left, 0.2 U, the reference moves on until the tank is at its floor."""
    rig = planar_rig()
    p, (row,) = rig.numbers(seed % 100), rig.random(np.random.default_rng(seed))
    t, U = rig.told.unpack(row), rig.law_says(row, p).potential
    away = 2 * t["position"] - rig.law_says(row, p).position
    told = rig.but(row, position=away, stiffness=2 * t["stiffness"])
    out = rig.run(rig.start(row, LEVELS["floor"] + 1.2 * U), told[None], p)
    assert out.entry_stiffness_share[0] == 1
    assert 0 < out.entry_reference_share[0] < 1
    assert out.tank_energy[0] >= LEVELS["floor"] - ROUND * U
    # The last halving: γ = 2⁻¹² of a way whose cost is at most 8 U.
    assert out.entry_granted[0] == pytest.approx(1.2 * U, rel=2**-12 * 8)


@each_rig
def test_the_power_limit_is_per_time_that_passed(make: Callable[[], Rig]) -> None:
    """A full tank grants P_max Δt, and three times that after two missed periods.

    The search leaves 2⁻¹² of the way, for a cost of γ² of the whole 2 · 2⁻¹² / γ of the budget, γ ≥ 0.2.
    """
    rig = make()
    told, home = slack(rig, 3, 1, rig.numbers(3))
    budget = 0.04 * rig.law_says(told[0], rig.numbers(3)).potential
    p = rig.numbers(3, power=budget / PERIOD)
    for periods in (1, 3):
        row = rig.but(told[0], elapsed=periods * PERIOD)
        out = rig.run(rig.start(home, FULL), row[None], p)
        assert periods * budget * (1 - 5e-3) <= out.entry_granted[0] <= periods * budget * (1 + ROUND)


@each_rig
@pytest.mark.parametrize("name", ACTIONS)
def test_a_reference_that_is_held_back_leads_by_its_share(make: Callable[[], Rig], name: str) -> None:
    """γ (D_x ẋ_d + Λ ẍ_d): what follows the reference goes as slowly as it; posture sees the one in force."""
    rig, (on, row) = make(), ACTIONS[name]
    told, home = slack(rig, 5, 1, rig.numbers(5), **row)
    power = 0.2 * rig.law_says(told[0], rig.numbers(5)).potential / PERIOD
    p, leads = rig.numbers(5, on, power=power), {k: v for k, v in on.items() if k.startswith("follow")}
    out = rig.run(rig.start(home, FULL), told, p)
    share = out.entry_reference_share[0]
    assert 0.2 < share < 0.8
    granted = governed(rig, told[0], out, 0)
    whole = np.array(rig.actions(granted, p)).ravel()
    lead = np.array(rig.actions(rig.but(told[0], wrench=np.zeros(6)), rig.numbers(5, leads))).ravel()
    expected = rig.law_says(granted, p, whole - (1 - share) * lead).command
    np.testing.assert_allclose(out.command[0], expected, rtol=0, atol=ROUND * np.abs(expected).max() * 10)


@pytest.mark.parametrize("rigid", [False, True], ids=["impedance", "rigid"])
@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_without_a_tank_the_law_commands_and_the_port_is_counted(rigid: bool, seed: int) -> None:
    rig = planar_rig(None, rigid=rigid)
    p = rig.numbers(seed % 100, ON)
    told = rig.random(np.random.default_rng(seed), 5)
    out = rig.run(rig.start(told[0], 0.0), told, p)
    for i, row in enumerate(told):
        torque = np.array(rig.actions(row, p)).ravel()
        np.testing.assert_array_equal(out.command[i], rig.law_says(row, p, torque).command)
        np.testing.assert_array_equal(out.governed_position[i], rig.told.unpack(row)["position"])
    t = rig.told.unpack(told)
    given_away = ((t["tau_a"][1:] + t["tau_a"][:-1]) * np.diff(t["q"], axis=0)).sum(axis=1) / 2
    np.testing.assert_allclose(
        out.measured_port_energy, np.cumsum([0, *given_away]), rtol=0, atol=1e-12 * 100
    )
    np.testing.assert_array_equal(out.entry_valve, 1)
    for name in (
        "tank_energy",
        "granted_energy",
        "drawn_energy",
        "refilled_energy",
        "spilled_energy",
        "latched",
    ):
        assert not getattr(out, name).any()


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_the_observer_in_the_time_domain_brakes_in_the_period_of_its_debt(seed: int) -> None:
    """−α φ̇ with α = debt / (Δt |φ̇|²), or α_max: on top of the law, and of no action."""
    rig = planar_rig(OBSERVER)
    p, (row,) = rig.numbers(seed % 100, ON), rig.random(np.random.default_rng(seed))
    dphi = rig.law_says(row, p).dphi
    for debt in (1e-6, 0.02, 50.0):
        out = rig.run(rig.start(row, -debt), row[None], p)
        alpha = min(debt / (PERIOD * dphi @ dphi), LEVELS["braking"])
        expected = rig.law_says(row, p, -alpha * dphi).command
        np.testing.assert_allclose(out.command[0], expected, rtol=0, atol=ROUND * np.abs(expected).max() * 10)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_the_variable_stiffness_goes_back_to_the_base_as_its_tank_runs_empty(seed: int) -> None:
    """K_base + β (K_x − K_base), in this period; the reference is not gated."""
    rig, share = planar_rig(VARIABLE), np.random.default_rng(seed).uniform(0, 1)
    p, told = rig.numbers(seed % 100), rig.random(np.random.default_rng(seed), 1, wrench=np.zeros(6))
    base, wanted = rig.gains(seed % 100)["stiffness"], rig.told.unpack(told[0])["stiffness"]
    beta = share**2 * (3 - 2 * share)
    for level, part in ((0.1, 0.0), (0.1 + 0.2 * share, beta), (FULL, 1.0)):
        out = rig.run(rig.start(told[0], level), told, p)
        expected = base + part * (wanted - base)
        np.testing.assert_allclose(out.held_stiffness[0], expected, rtol=0, atol=1e-9)
        command = rig.law_says(governed(rig, told[0], out, 0), p).command
        np.testing.assert_array_equal(out.command[0], command)
        assert out.entry_reference_share[0] == 1
