"""A controller's books over many periods, its fallback, and what it makes of measurements that are none."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings

from loops import SEEDS
from passiflex.sampled.external import MomentumObserver
from passiflex.sampled.tanks import PortTank
from sampled.periods import FULL, LEVELS, PERIOD, Rig, planar_rig, spatial_rig

LONG, TRIP = 1000, 0.05
ON = {
    "follow_velocity": 0.7,
    "follow_acceleration": 0.9,
    "coulomb_compensation": 1.5,
    "viscous_compensation": 2.0,
    "posture_stiffness": 40.0,
    "posture_damping": 3.0,
}
RIGS = {"position": planar_rig, "pose": spatial_rig}
PORT, OBSERVED = PortTank(), MomentumObserver()
BAD = (np.nan, np.inf, -np.inf, 1e200)

each_rig = pytest.mark.parametrize("make", RIGS.values(), ids=RIGS)


def energies(
    rig: Rig, told: np.ndarray, out: SimpleNamespace, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return w and S of each row, from the measurements and the law alone; w of the first row is 0."""
    t, fallen = rig.told.unpack(told), rig.fallen(p)
    w = ((t["tau_a"][1:] + t["tau_a"][:-1]) * np.diff(t["q"], axis=0)).sum(axis=1) / 2
    wishes = [
        rig.but(row, position=position, rotation=axes, stiffness=K)
        for row, position, axes, K in zip(
            told, out.governed_position, out.governed_rotation, out.held_stiffness, strict=True
        )
    ]
    S = [rig.law_says(r, fallen if fell else p).storage for r, fell in zip(wishes, out.latched, strict=True)]
    return np.array([0, *w]), np.array(S)


def chaos(rig: Rig, seed: int, length: int) -> np.ndarray:
    """Return rows of unphysical measurements and wishes; gains switch every 100 rows, and periods are missed."""
    rng = np.random.default_rng(seed)
    told, at = rig.random(rng, length), rig.told.slices
    told[:, at["elapsed"]] = PERIOD * rng.choice([1, 1, 1, 2, 5], (length, 1))
    for name in ("stiffness", "damping"):
        told[:, at[name]] = told[::100, at[name]].repeat(100, axis=0)[:length]
    return told


@each_rig
@pytest.mark.parametrize("trip", [LEVELS["trip"], TRIP], ids=["never falls back", "falls back"])
def test_tank_storage_and_port_have_a_constant_sum(make: Callable[[], Rig], trip: float) -> None:
    """T + S + Σw + Σspilled over 1000 periods, with S and w found from the measurements: 1e-12 of what passed."""
    rig = make()
    p, told = rig.numbers(1, ON, cap=100.0, trip=trip), chaos(rig, 1, LONG)
    out = rig.run(rig.start(told[0], 50.0), told, p)
    w, S = energies(rig, told, out, p)
    passed = np.cumsum(np.abs(w) + np.abs(np.diff(S, prepend=0)) + out.entry_granted)
    assert np.isfinite(out.states).all()
    np.testing.assert_allclose(out.law_storage, S, rtol=1e-12, atol=1e-12 * passed[-1])
    np.testing.assert_allclose(out.measured_port_energy, np.cumsum(w), rtol=0, atol=1e-12 * passed[-1])
    total = out.tank_energy + S + np.cumsum(w) + out.spilled_energy
    np.testing.assert_allclose(total, 50.0 + S[0], rtol=0, atol=1e-12 * passed[-1])
    assert out.spilled_energy[-1] > 0
    assert out.latched.any() == (trip == TRIP)
    paid = out.granted_energy + out.drawn_energy + out.spilled_energy
    balance = 50.0 - paid + out.refilled_energy + out.rebased_energy
    np.testing.assert_allclose(out.tank_energy, balance, rtol=0, atol=1e-12 * passed[-1])
    assert out.rebased_energy.any() == (trip == TRIP)
    if trip != TRIP:
        assert (out.entry_reference_share < 1).any()
        assert (out.entry_stiffness_share < 1).any()
        for name in ("granted", "drawn", "refilled", "spilled"):
            booked = np.cumsum(getattr(out, f"entry_{name}"))
            np.testing.assert_allclose(getattr(out, f"{name}_energy"), booked, rtol=1e-12)
    # Also what it was before the grant of its period, and before it was based anew.
    assert (out.lowest_level <= np.minimum(50.0, np.minimum.accumulate(out.tank_energy))).all()
    assert (np.diff(out.lowest_level) <= 0).all()
    assert out.lowest_level[-1] < TRIP or trip != TRIP
    # The valve goes by the level after the grant, and no grant passes the floor, stiffness and pose together.
    x = np.clip((out.tank_energy - LEVELS["floor"]) / (LEVELS["low"] - LEVELS["floor"]), 0, 1)
    np.testing.assert_allclose(out.entry_valve, (1 - out.latched) * x**2 * (3 - 2 * x), rtol=0, atol=1e-12)
    assert ((out.entry_granted == 0) | (out.tank_energy >= LEVELS["floor"] - 1e-12 * passed)).all()


def test_the_papers_accounting_loses_what_the_reference_gives_back() -> None:
    """T + S + Σw + Σspilled falls by 2|ΔU| where a granted change has ΔU < 0, and never rises."""
    rig = planar_rig()
    p, told = rig.numbers(2, signed=0.0, cap=100.0), chaos(rig, 2, 300)
    out = rig.run(rig.start(told[0], 50.0), told, p)
    w, S = energies(rig, told, out, p)
    total = out.tank_energy + S + np.cumsum(w) + out.spilled_energy
    passed = np.sum(np.abs(w)) + np.sum(np.abs(np.diff(S)))
    stored = np.diff(out.reference_energy, prepend=0)
    # Two changes in a row, stiffness and pose, may have opposite signs: granted = |ΔU₁| + |ΔU₂|.
    lost = np.cumsum(out.entry_granted - stored)
    np.testing.assert_allclose(total, 50.0 + S[0] + stored[0] - lost, rtol=0, atol=1e-12 * passed)
    assert (np.diff(total) <= 1e-12 * passed).all()
    assert lost[-1] > 1


@each_rig
def test_the_first_period_books_nothing(make: Callable[[], Rig]) -> None:
    """There is no period before it: no work, no change of S; the tank is what it was, and what it paid."""
    rig = make()
    p, (row, other) = rig.numbers(3, ON), rig.random(np.random.default_rng(3), 2)
    out = rig.run(rig.start(row, 0.7), row[None], p)
    assert out.tank_energy[0] == 0.7
    booked = ("port_energy", "granted", "drawn", "refilled", "spilled")
    assert not np.any([getattr(out, f"entry_{name}") for name in booked])
    assert out.law_storage[0] == pytest.approx(rig.law_says(row, p).storage, rel=1e-14)
    out = rig.run(rig.start(other, FULL), row[None], p)
    paid = out.entry_granted - out.entry_refilled
    assert out.tank_energy[0] == pytest.approx(FULL - paid[0], rel=1e-15)
    assert out.entry_port_energy[0] == out.entry_drawn[0] == 0


def overdrawn(rig: Rig, seed: int, p: np.ndarray, by: float) -> tuple[np.ndarray, np.ndarray]:
    """Return two rows, and a start from which the second one settles at the trip less `by`, before any grant.

    The first one is at least 1 J above the trip, less `by`: the second gives |ΔS| + 1 J to the links.
    """
    first, second = rig.random(np.random.default_rng(seed), 2)
    t, moved = rig.told.unpack(first), rig.told.unpack(second)["q"] - rig.told.unpack(first)["q"]
    held = rig.but(second, position=t["position"], rotation=t["rotation"], stiffness=t["stiffness"])
    change = rig.law_says(held, p).storage - rig.law_says(first, p).storage
    w = abs(change) + 1
    second = rig.but(second, tau_a=2 * w * moved / (moved @ moved) - t["tau_a"])
    return np.array([first, second]), rig.start(first, TRIP - by + w + change)


@each_rig
@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_an_overdrawn_tank_makes_the_law_fall_back_at_once(make: Callable[[], Rig], seed: int) -> None:
    """In the period in which it shows, with the fallback's gains, at the pose just read; T + S does not jump."""
    rig = make()
    p = rig.numbers(seed % 100, ON, trip=TRIP)
    told, start = overdrawn(rig, seed, p, by=1e-3)
    out = rig.run(start, told, p)
    np.testing.assert_array_equal(out.latched, [0, 1])
    fallen = rig.fallen(p)
    gains = rig.gains(seed % 100 + 1)
    here = rig.law_says(told[1], fallen)
    np.testing.assert_array_equal(out.governed_position[1], here.position)
    np.testing.assert_array_equal(out.governed_rotation[1], here.rotation)
    np.testing.assert_array_equal(out.held_stiffness[1], gains["stiffness"])
    now = rig.but(
        told[1],
        position=here.position,
        rotation=here.rotation,
        stiffness=gains["stiffness"],
        damping=gains["damping"],
    )
    expected = rig.law_says(now, fallen)
    np.testing.assert_array_equal(out.command[1], expected.command)
    assert out.entry_valve[1] == 0
    before, after = (out.tank_energy[i] + out.law_storage[i] for i in (0, 1))
    passed = np.abs([out.tank_energy[0], *out.law_storage, out.entry_port_energy[1], 1.0]).sum()
    assert after == pytest.approx(before - out.entry_port_energy[1], rel=0, abs=1e-13 * passed)
    assert out.law_storage[1] == pytest.approx(expected.storage, rel=0, abs=1e-13 * passed)


@each_rig
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_the_valve_shuts_in_the_period_that_empties_the_tank(make: Callable[[], Rig], seed: int) -> None:
    """Not a step late: open in the first row, and nothing of the actions left in the second one."""
    rig = make()
    p = rig.numbers(seed % 100, ON)
    told, start = overdrawn(rig, seed, p, by=TRIP - LEVELS["floor"] + 1e-6)
    setpoint = {name: rig.told.unpack(told[0])[name] for name in ("position", "rotation", "stiffness")}
    told[1] = rig.but(told[1], **setpoint)
    out = rig.run(start, told, p)
    np.testing.assert_array_equal(out.entry_valve, [1, 0])
    np.testing.assert_array_equal(out.command[1], rig.law_says(told[1], p).command)
    torque = np.array(rig.actions(told[0], p)).ravel()
    speed = rig.told.unpack(told[0])["dtheta"]
    against = (
        ON["coulomb_compensation"] * speed * np.abs(speed) / (1 + speed**2)
        + ON["viscous_compensation"] * speed
    )
    expected = rig.law_says(told[0], p, torque).command + against
    np.testing.assert_allclose(out.command[0], expected, rtol=1e-14, atol=1e-13)


@each_rig
@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_a_level_above_the_trip_changes_nothing(make: Callable[[], Rig], seed: int) -> None:
    rig = make()
    p = rig.numbers(seed % 100, ON, trip=TRIP)
    told, start = overdrawn(rig, seed, p, by=-1e-3)
    out = rig.run(start, told, p)
    assert not out.latched.any()
    without = rig.run(start, told, rig.numbers(seed % 100, ON, trip=LEVELS["trip"]))
    np.testing.assert_array_equal(out.states, without.states)
    np.testing.assert_array_equal(out.command, without.command)


@each_rig
def test_a_law_that_has_fallen_back_stays_so(make: Callable[[], Rig]) -> None:
    """For good, whatever the tank holds then: nothing is granted, no action acts, the fallback's gains are in force."""
    rig = make()
    p = rig.numbers(4, ON, trip=TRIP)
    told, start = overdrawn(rig, 4, p, by=5.0)
    fell = rig.run(start, told, p)
    rich = rig.controller.state.unpack(fell.end.copy())
    state = rig.controller.state.pack(rich | {"tank_energy": FULL})
    later = chaos(rig, 5, 200)
    out = rig.run(state, later, p)
    assert (out.latched == 1).all()
    assert not out.entry_valve.any()
    assert not np.any([out.entry_granted, out.reference_energy - rich["reference_energy"]])
    for name in ("governed_position", "governed_rotation", "held_stiffness"):
        np.testing.assert_array_equal(getattr(out, name), np.tile(rich[name], (200, *[1] * rich[name].ndim)))
    held = {"position": rich["governed_position"], "rotation": rich["governed_rotation"]}
    held |= {"stiffness": rich["held_stiffness"], "damping": rig.gains(5)["damping"]}
    fallen = rig.fallen(p)
    for row, command in zip(later[:50], out.command, strict=False):
        np.testing.assert_array_equal(command, rig.law_says(rig.but(row, **held), fallen).command)


@pytest.mark.parametrize("bad", BAD)
def test_a_bad_number_repeats_the_command_and_changes_nothing_but_the_count(bad: float) -> None:
    """Any entry of the measurement or of the setpoint; the estimator's memory does not change either."""
    rig = planar_rig(PORT, OBSERVED)
    p, told = rig.numbers(6, ON), rig.random(np.random.default_rng(6), 3)
    begin = rig.run(rig.start(told[0], 5.0), told[:2], p)
    usual = rig.run(begin.end, told[2:], p)
    for i in range(rig.told.size):
        wrong = told[2:].copy()
        wrong[0, i] = bad
        out = rig.run(begin.end, wrong, p)
        np.testing.assert_array_equal(out.command[0], begin.command[1])
        lost = rig.told.unpack(wrong[0])["elapsed"]
        counted = {"faults": 1.0, "lost_time": lost if abs(lost) < 1e30 else 0.0}
        same = rig.controller.state.pack(rig.controller.state.unpack(begin.end) | counted)
        np.testing.assert_array_equal(out.end, same)
        assert out.entry_fault[0] == 1
    assert usual.entry_fault[0] == usual.faults[0] == 0
    assert (usual.command[0] != begin.command[1]).all()


def test_after_a_bad_measurement_all_goes_on_as_if_the_period_had_been_missed() -> None:
    rig = planar_rig(PORT, OBSERVED)
    p, told = rig.numbers(7, ON), chaos(rig, 7, 30)
    bad = told.copy()
    bad[10:13, rig.told.slices["q"].start] = np.nan
    start, when = rig.start(told[0], 50.0), rig.told.slices["elapsed"]
    without = np.delete(told, range(10, 13), axis=0)
    without[10, when] = told[10:14, when].sum()
    ours, theirs = rig.run(start, bad, p), rig.run(start, without, p)
    fields = rig.controller.state.slices["faults"]
    np.testing.assert_array_equal(np.delete(ours.end, fields), np.delete(theirs.end, fields))
    assert ours.faults[-1] == 3
    np.testing.assert_array_equal(ours.command[13:], theirs.command[10:])
