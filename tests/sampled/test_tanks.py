"""The four tanks hold every property of the suite, tanks with one fault fail the property that it violates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace
from typing import final

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loops import SEEDS
from passiflex.sampled.tank import LARGEST, AbstractTank, PeriodFlows, TankEntry, booked, finite
from passiflex.sampled.tanks import TANKS, PaperTank, PortTank, TimeDomainTank, VariableStiffnessTank
from passiflex.scenarios.tank_uses import SAMPLED
from sampled.bench import Bench, Case, Contract
from sampled.conformance import PROPERTIES, ROUND, violated
from sampled.sequences import (
    SIZES,
    STABLE,
    UNSTABLE,
    MassOnSpring,
    adversarial_cases,
    random_case,
    tank_numbers,
)

PORT, PAPER, OBSERVER, VARIABLE = PortTank(), PaperTank(), TimeDomainTank(), VariableStiffnessTank()
CONTRACTS = {
    PORT: Contract(
        flow=lambda f, g: -f.storage_change - f.port_energy,
        reads=frozenset({"storage_change", "port_energy"}),
    ),
    PAPER: Contract(flow=lambda f, g: g.tank_fill * f.claimed_loss, reads=frozenset({"claimed_loss"})),
    OBSERVER: Contract(
        flow=lambda f, g: -f.port_energy, reads=frozenset({"port_energy"}), charges=False, gates=False
    ),
    VARIABLE: Contract(
        flow=lambda f, g: g.tank_fill * f.claimed_cartesian_loss + f.variable_spring_work,
        reads=frozenset({"claimed_cartesian_loss", "variable_spring_work"}),
        charges=False,
        gates=False,
    ),
}
CASES = st.builds(random_case, SEEDS, st.sampled_from(sorted(SIZES)), st.sampled_from([1, 6, 40]))
LONG = 600


def named(thing: object) -> str:
    return getattr(thing, "__name__", type(thing).__name__)


@pytest.mark.parametrize("holds", PROPERTIES, ids=named)
@pytest.mark.parametrize("tank", CONTRACTS, ids=named)
@settings(max_examples=25, deadline=None)
@given(case=CASES)
def test_random_requests(tank: AbstractTank, holds: Callable[[Bench], None], case: Case) -> None:
    holds(Bench(tank, CONTRACTS[tank], case))


@lru_cache
def fixed_cases() -> list[Case]:
    return adversarial_cases()


@pytest.mark.parametrize("tank", CONTRACTS, ids=named)
def test_recorded_and_long_sequences(tank: AbstractTank) -> None:
    long = [random_case(seed, kind, LONG) for seed, kind in enumerate(SIZES)]
    assert violated(tank, CONTRACTS[tank], [*fixed_cases(), *long]) == set()


@final
@dataclass(frozen=True, eq=False)
class BrokenTank(AbstractTank):
    """The tank at the port with one of its methods replaced."""

    flow: Callable[..., cs.SX] = PORT.flow
    settle: Callable[..., TankEntry] = PORT.settle
    pay: Callable[..., TankEntry] = PORT.pay
    budget: Callable[..., cs.SX] = PORT.budget
    braking: Callable[..., cs.SX] = PORT.braking
    stiffness_share: Callable[..., cs.SX] = PORT.stiffness_share
    valve: Callable[..., cs.SX] = PORT.valve


def counts_twice(T: cs.SX, flows: PeriodFlows, g: SimpleNamespace) -> TankEntry:
    """Adds its power twice, and says so."""
    return PORT.settle(T, PeriodFlows(*(2 * flow for flow in flows)), g)


def counts_twice_unseen(T: cs.SX, flows: PeriodFlows, g: SimpleNamespace) -> TankEntry:
    """Takes twice what it reports."""
    entry = PORT.settle(T, flows, g)
    return entry._replace(level=entry.level - entry.drawn)


def lifts_to_the_floor(T: cs.SX, flows: PeriodFlows, g: SimpleNamespace) -> TankEntry:
    """Lifts its level to the floor first, as if that came in."""
    lift = cs.if_else(finite(T), cs.fmax(g.tank_floor - T, 0), 0)
    entry = PORT.settle(T + lift, flows, g)
    return entry._replace(refilled=entry.refilled + lift)


def divides_by_the_level(T: cs.SX, flows: PeriodFlows, g: SimpleNamespace) -> TankEntry:
    """Goes by n = √(2T), and divides by it: 1 is written so that CasADi does not cancel it."""
    entry = PORT.settle(T, flows, g)
    return entry._replace(level=entry.level * (cs.sqrt(2 * T) / cs.sqrt(T + T)))


def forgets_what_it_spills(T: cs.SX, flows: PeriodFlows, g: SimpleNamespace) -> TankEntry:
    """Reports as refilled what fits, and nothing of the rest."""
    entry = PORT.settle(T, flows, g)
    fits = cs.if_else(entry.spilled > 0, cs.fmax(entry.level - T, 0), entry.refilled)
    return entry._replace(refilled=fits, spilled=cs.SX(0))


def spills_unseen(T: cs.SX, flows: PeriodFlows, g: SimpleNamespace) -> TankEntry:
    """Caps its level, and reports nothing of it."""
    return PORT.settle(T, flows, g)._replace(spilled=cs.SX(0))


def is_poisoned(T: cs.SX, flows: PeriodFlows, g: SimpleNamespace) -> TankEntry:
    """Believes every number."""
    flow = -flows.storage_change - flows.port_energy
    return booked(T, granted=0, flow=flow, cap=g.tank_cap, ok=cs.SX(1))


def pays_half(T: cs.SX, cost: cs.SX, g: SimpleNamespace) -> TankEntry:
    """Charges half of a jump."""
    return PORT.pay(T, cost / 2, g)


def grants_below_the_floor(T: cs.SX, elapsed: cs.SX, g: SimpleNamespace) -> cs.SX:
    """Grants down to 0."""
    return PORT.budget(T + g.tank_floor, elapsed, g)


def closes_late(T: cs.SX, g: SimpleNamespace) -> cs.SX:
    """Stays open until the tank is empty."""
    return cs.if_else(T > 0, 1, 0)


def brakes_too_much(T: cs.SX, speed: cs.SX, elapsed: cs.SX, g: SimpleNamespace) -> cs.SX:
    """Pays any debt with all it has."""
    return cs.if_else(T < 0, g.tank_braking, 0)


BROKEN = {
    counts_twice: (BrokenTank(settle=counts_twice), {"a_joule_counts_once"}),
    counts_twice_unseen: (BrokenTank(settle=counts_twice_unseen), {"books_close"}),
    lifts_to_the_floor: (BrokenTank(settle=lifts_to_the_floor), {"the_floor_lifts_nothing"}),
    divides_by_the_level: (BrokenTank(settle=divides_by_the_level), {"outputs_are_finite"}),
    forgets_what_it_spills: (BrokenTank(settle=forgets_what_it_spills), {"the_cap_spills"}),
    spills_unseen: (BrokenTank(settle=spills_unseen), {"the_cap_spills", "books_close"}),
    is_poisoned: (BrokenTank(settle=is_poisoned), {"bad_numbers_change_nothing"}),
    pays_half: (BrokenTank(pay=pays_half), {"a_jump_costs_what_it_stores"}),
    grants_below_the_floor: (
        BrokenTank(budget=grants_below_the_floor),
        {"spending_stays_within_the_budget"},
    ),
    closes_late: (BrokenTank(valve=closes_late), {"the_valve_follows_the_level"}),
    brakes_too_much: (BrokenTank(braking=brakes_too_much), {"braking_pays_no_more_than_the_debt"}),
}


@pytest.mark.parametrize("fault", BROKEN, ids=named)
def test_a_fault_fails_the_property_that_it_violates(fault: Callable[..., object]) -> None:
    tank, properties = BROKEN[fault]
    assert violated(tank, CONTRACTS[PORT], fixed_cases()) == properties


def test_every_property_sees_a_fault() -> None:
    assert set.union(*(names for _, names in BROKEN.values())) == {named(holds) for holds in PROPERTIES}


def test_energies_of_numbers_that_pass_are_numbers() -> None:
    """So that a storage never is ∞, and ∞ − ∞ never a level."""
    assert np.isfinite(1e6 * LARGEST**2)


def run(tank: AbstractTank, case: Case) -> SimpleNamespace:
    return Bench(tank, CONTRACTS[tank], case).sequence


def storage_of(case: Case, S_0: float, paid: TankEntry) -> np.ndarray:
    """Return S at the end of each period, after the change that was granted."""
    signed = np.sign(case.costs) * np.maximum(paid.granted, paid.refilled)
    return S_0 + np.cumsum(case.flows[2] + signed)


@settings(max_examples=25, deadline=None)
@given(case=CASES, S_0=st.floats(0, 10))
def test_the_port_tank_keeps_the_energy(case: Case, S_0: float) -> None:
    """T + S + Σw + Σspilled is constant if signed, and falls by 2|ΔU| at each change that gives energy back if not."""
    s = run(PORT, case)
    gone = np.cumsum(s.settled.spilled + s.paid.spilled)
    unfair = 0.0 if case.g.tank_signed else np.cumsum(np.where(case.costs < 0, 2 * s.paid.granted, 0))
    S, given_away = storage_of(case, S_0, s.paid), np.cumsum(case.flows[1])
    total = s.paid.level + S + given_away + gone + unfair
    scale = np.cumsum(np.abs(case.flows[1:3]).sum(axis=0) + s.paid.granted + s.paid.refilled + gone)
    error = ROUND * (scale + np.abs(case.level) + S_0) * np.arange(2, scale.size + 2)
    assert np.all(np.abs(total - case.level - S_0) <= error)
    assert np.all((given_away <= S_0 + case.level + error) | (s.paid.level < 0) | (S < 0))


@pytest.mark.parametrize("signed", [0.0, 1.0])
@pytest.mark.parametrize("plant", [STABLE, UNSTABLE], ids=["stable", "unstable"])
def test_the_port_is_passive_while_the_tank_is_not_overdrawn(plant: MassOnSpring, signed: float) -> None:
    """Σw ≤ S_0 + T_0 wherever T ≥ 0, whatever the controller; without jumps T shows all that the mass has gained."""
    case, path = plant.record(60, 1.0, 0.05, signed=signed, cap=1e9)
    s, S_0 = run(PORT, case), plant.spring(path.x[0], path.goal[0])
    given_to_mass = np.cumsum(case.flows[1])
    assert np.allclose(given_to_mass, plant.kinetic(path.v[1:]), rtol=1e-9)
    assert np.all((given_to_mass <= S_0 + 1.0) | (s.paid.level < 0))
    assert np.any(s.paid.level < 0) == (plant is UNSTABLE)


@pytest.mark.parametrize("plant", [STABLE, UNSTABLE], ids=["stable", "unstable"])
def test_the_paper_tank_credits_what_nobody_dissipated(plant: MassOnSpring) -> None:
    """Its own books close; against the port's it is too high by Σ(d v² Δt − real loss), in closed form.

    Per period that is ½ k Δx² − ½ d v f Δt² / m: without the spring a² times the kinetic energy, a = d Δt / m.
    """
    case, path = plant.record(60, 1.0, 0.0, cap=1e9)
    paper, port = run(PAPER, case), run(PORT, case)
    v, f = path.v[:-1], -plant.k * path.x[:-1] - plant.d * path.v[:-1]
    excess = plant.k * np.diff(path.x) ** 2 / 2 - plant.d * v * f / plant.m * plant.dt**2 / 2
    np.testing.assert_allclose(paper.paid.level, 1 + np.cumsum(case.flows[3]), rtol=1e-12)
    gap = paper.paid.level - port.paid.level
    np.testing.assert_allclose(gap, np.cumsum(excess), rtol=1e-9, atol=1e-13)
    if plant is UNSTABLE:
        a = plant.d * plant.dt / plant.m
        assert gap[-1] == pytest.approx(a**2 * plant.kinetic(v).sum(), rel=0.05)
        assert paper.paid.level[-1] > 1.0 > 0 > port.paid.level[-1]
    else:
        assert abs(gap[-1]) < 0.01 * case.flows[3].sum()


@given(st.floats(-10, -1e-6), st.floats(1e-6, 1e4), st.floats(1e-6, 1))
def test_the_observer_pays_its_debt_within_a_period_if_it_may(T: float, speed: float, dt: float) -> None:
    """α |φ̇|² Δt = −E if α ≤ α_max allows it, and α = α_max otherwise."""
    case = Case(tank_numbers(), T, np.full((6, 1), dt), np.zeros(1), np.full(1, speed))
    (brake,) = Bench(OBSERVER, CONTRACTS[OBSERVER], case).braking(np.array([T]), case.speeds, case.flows[0])
    assert brake == pytest.approx(min(-T / (speed * dt), 100.0), rel=1e-14)


@given(CASES)
def test_the_variable_part_of_the_spring_goes_with_the_valve(case: Case) -> None:
    bench = Bench(VARIABLE, CONTRACTS[VARIABLE], case)
    levels = np.append(case.levels(), np.linspace(case.g.tank_floor, case.g.tank_low, 20))
    np.testing.assert_array_equal(bench.stiffness_share(levels), bench.valve(levels))


@pytest.mark.parametrize("tank", CONTRACTS, ids=named)
def test_a_tank_says_of_itself_what_its_contract_says(tank: AbstractTank) -> None:
    contract = CONTRACTS[tank]
    assert (set(tank.reads), tank.charges, tank.gates) == (contract.reads, contract.charges, contract.gates)
    assert TANKS[tank.kind] is type(tank)
    assert tank.title


def test_every_kind_of_tank_has_its_settings() -> None:
    assert set(TANKS) == set(SAMPLED)


class Leaking(AbstractTank):
    """A tank that somebody brings: the port tank, less a tenth of all that comes in."""

    kind, reads = "leaking", PortTank.reads

    def flow(self, flows: PeriodFlows, g: SimpleNamespace) -> cs.SX:
        flow = PORT.flow(flows, g)
        return flow - cs.fmax(flow, 0) / 10


def test_a_tank_from_outside_is_its_flow() -> None:
    def flow(f: PeriodFlows, g: SimpleNamespace) -> np.ndarray:
        taken = -f.storage_change - f.port_energy
        return taken - np.maximum(taken, 0) / 10

    contract = Contract(flow, frozenset(Leaking.reads))
    assert violated(Leaking(), contract, fixed_cases()) == set()
