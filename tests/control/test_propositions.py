"""Propositions 1–3: plant (2) under the law (5), (12), (32) is the vector field of (9), (13) and (24) corrected.

The closed loop is evaluated as the simulation does it, in (q, θ, q̇, θ̇, T, clock), and carried over to the
paper's coordinates by exact derivatives; the systems are written from their Hamiltonians alone. Both sides are
round-off of the same number, amplified by cond(M) and by the solve of Λ: 1e-9 of the block's largest entry.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings

from loops import GRAVITY, SEEDS, PaperCoordinates, impedance_gains, robots, tank_numbers
from passiflex.control import (
    AbstractGravity,
    AbstractTask,
    ImpedanceLaw,
    MotorGravity,
    PoseTask,
    PositionTask,
    RobotGravity,
    StaticGravity,
)
from passiflex.control.systems import augmented_system, impedance_system, shaped_system
from passiflex.phs import PortHamiltonianSystem
from passiflex.robots.flexible import FlexibleJointRobot

RELATIVE = 1e-9
TASKS = (PoseTask(), PositionTask(), PoseTask(free=(0, 5)))
GRAVITIES = (RobotGravity(), MotorGravity(), StaticGravity())
FILLS = (1.0, 0.0, 0.37)


def named(value: object) -> str:
    return type(value).__name__


class Case:
    """A law, its closed loop in the paper's coordinates, and the three systems."""

    def __init__(self, law: ImpedanceLaw):
        self.law, self.n = law, law.robot.n
        self.paper = PaperCoordinates.of(law)
        self.shaped, self.impedance = shaped_system(law.robot), impedance_system(law)
        self.augmented = augmented_system(law)
        self.fields = {
            name: system.function(system.vector_field, system.hamiltonian_rate, system.hamiltonian)
            for name, system in (
                ("shaped", self.shaped), ("impedance", self.impedance), ("augmented", self.augmented)
            )
        }  # fmt: skip
        gravity = GRAVITY if law.gravity.in_model else (0.0, 0.0, 0.0)
        self.model = law.robot.layout.pack(law.robot.nominal(gravity))


class Sample:
    """One random state, input and set of gains, and what the closed loop does there."""

    def __init__(self, case: Case, rng: np.random.Generator, fill: float, **fixed: float):
        self.fill = fill
        self.gains = case.law.layout.pack(impedance_gains(case.law, rng, **fixed))
        p = np.concatenate([case.model, case.model, self.gains, tank_numbers(fill)])
        x = case.paper.random_state(rng, tank_energy=rng.uniform(0.1, 5))
        u = case.paper.random_input(rng)
        self.state, self.rate, self.tau_e, self.tau_u, self.twist, powers = case.paper(x, u, p)
        self.power = {k: v.item() for k, v in case.paper.loop.energies.unpack(powers).items()}
        parts = ("joint_damping", "cartesian_damping", "null_space_damping")
        self.P_D, self.P_X = sum(self.power[k] for k in parts), self.power["reference"]


def samples(case: Case, seed: int, **fixed: float) -> Iterator[Sample]:
    rng = np.random.default_rng(seed)
    for fill in FILLS:
        yield Sample(case, rng, fill, **fixed)


def check_same(ours: np.ndarray, theirs: np.ndarray, n: int) -> None:
    """Compare block by block: q̇, φ̇, ṗ, ż, ṅ, ṗ_d, Ṙ_d."""
    edges = [k for k in (n, 2 * n, 3 * n, 4 * n, 4 * n + 1, 4 * n + 4) if k < len(theirs)]
    for a, b in zip(np.split(ours, edges), np.split(theirs, edges), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=RELATIVE * np.abs(b).max())


def field(case: Case, name: str, *arguments: np.ndarray) -> tuple[np.ndarray, float, float]:
    dx, rate, H = case.fields[name](*arguments)
    return np.array(dx).ravel(), float(rate), float(H)


def check_inner_loop(case: Case, s: Sample) -> None:
    """(2) + (5) = (9), whatever τ_u."""
    mechanical = s.state[: 4 * case.n]
    K_e, B_e = s.gains[: case.n], s.gains[case.n : 2 * case.n]
    u, p = np.concatenate([s.tau_e, s.tau_u]), np.concatenate([case.model, K_e, B_e])
    check_same(field(case, "shaped", mechanical, u, p)[0], s.rate[: 4 * case.n], case.n)
    assert case.shaped.structure(mechanical, u, p).holds()


def check_impedance(case: Case, s: Sample) -> None:
    """(2) + (5) + (12) + (32) = (13), with the reference where it is now."""
    mechanical, desired = s.state[: 4 * case.n], s.state[4 * case.n + 1 :]
    u = np.concatenate([s.tau_e, np.zeros(case.n)])
    p = np.concatenate([case.model, s.gains, desired])
    check_same(field(case, "impedance", mechanical, u, p)[0], s.rate[: 4 * case.n], case.n)
    assert case.impedance.structure(mechanical, u, p).holds()


def check_augmented(case: Case, s: Sample) -> None:
    """… + (19) = (24) corrected, and Ḣ₂ = −(1 − α) P_D + P_X − |P_X| + τ_eᵀ q̇, Ṫ = n ṅ = α P_D − |P_X|."""
    n = case.n
    u, p = np.concatenate([s.tau_e, np.zeros(n), s.twist]), np.concatenate([case.model, s.gains, [s.fill]])
    dx, rate, _ = field(case, "augmented", s.state, u, p)
    check_same(dx, s.rate, n)
    structure = case.augmented.structure(s.state, u, p)
    assert structure.holds()
    expected = -(1 - s.fill) * s.P_D + s.P_X - abs(s.P_X) + s.tau_e @ s.rate[:n]
    assert abs(rate - expected) <= RELATIVE * structure.scale
    T_rate = s.state[4 * n] * s.rate[4 * n]
    assert abs(T_rate - (s.fill * s.P_D - abs(s.P_X))) <= RELATIVE * (s.P_D + abs(s.P_X))
    assert s.P_D >= 0


CHECKS = (check_inner_loop, check_impedance, check_augmented)


@pytest.mark.parametrize("gravity", GRAVITIES, ids=named)
@pytest.mark.parametrize("task", TASKS, ids=named)
@settings(max_examples=4, deadline=None)
@given(robot=robots(1, 3), seed=SEEDS)
def test_propositions_hold_for_random_arms(
    task: AbstractTask, gravity: AbstractGravity, robot: FlexibleJointRobot, seed: int
) -> None:
    case = Case(ImpedanceLaw(robot, task, gravity))
    for sample in samples(case, seed):
        for check in CHECKS:
            check(case, sample)


@lru_cache
def iiwa(task: AbstractTask) -> Case:
    return Case(ImpedanceLaw(FlexibleJointRobot.load("iiwa14"), task, StaticGravity()))


@pytest.mark.parametrize("k_ns", [0.0, 5.0])
@pytest.mark.parametrize("check", CHECKS, ids=lambda f: f.__name__)
def test_propositions_hold_for_the_iiwa(check: object, k_ns: float) -> None:
    """With the null space, without it, and with ε = 0 as printed."""
    case = iiwa(PoseTask())
    for seed in range(4):
        for sample in samples(case, seed, null_space_damping=k_ns, regularisation=0.0 if seed % 2 else 1e-9):
            check(case, sample)


@settings(max_examples=1, deadline=None)
@given(robots(8, 8), SEEDS)
def test_propositions_hold_for_eight_joints(robot: FlexibleJointRobot, seed: int) -> None:
    case = Case(ImpedanceLaw(robot, PoseTask(), RobotGravity()))
    for sample in samples(case, seed):
        for check in CHECKS:
            check(case, sample)


def test_the_printed_24_would_lose_the_dissipation() -> None:
    """Why (24) is corrected: with α = 0 the printed one has no damping left in ṗ and ż, which reality has."""
    case = iiwa(PoseTask())
    sample = Sample(case, np.random.default_rng(0), 0.0)
    system = case.augmented
    n = case.n
    printed = PortHamiltonianSystem(
        system.state, system.inputs, system.parameters, system.hamiltonian, system.interconnection,
        cs.diagcat(cs.SX(4 * n, 4 * n), system.dissipation[4 * n :, 4 * n :]), system.input_map,
    )  # fmt: skip
    u = np.concatenate([sample.tau_e, np.zeros(n), sample.twist])
    p = np.concatenate([case.model, sample.gains, [0.0]])
    dx = np.array(printed.function(printed.vector_field)(sample.state, u, p)).ravel()
    missing = np.abs(dx - sample.rate)[2 * n : 4 * n].max()
    assert missing > 1e-3 * np.abs(sample.rate[2 * n : 4 * n]).max()


@pytest.mark.parametrize("task", TASKS, ids=named)
def test_outer_loop_power_closes(task: AbstractTask) -> None:
    """Along the closed loop, the claims of the law are (14): Ḣ₁ = −P_D + P_X + τ_eᵀ q̇ (18)."""
    case = iiwa(task)
    n = case.n
    for sample in samples(case, 11):
        p = np.concatenate([case.model, sample.gains, sample.state[4 * n + 1 :]])
        system = case.impedance
        x, d = system.state, system.parameters[len(case.model) + len(sample.gains) :]
        slopes = system.function(cs.gradient(system.hamiltonian, x), cs.gradient(system.hamiltonian, d))
        dH_x, dH_d = (np.array(v).ravel() for v in slopes(sample.state[: 4 * n], np.zeros(2 * n), p))
        rate = dH_x @ sample.rate[: 4 * n] + dH_d @ sample.rate[4 * n + 1 :]
        scale = np.abs(dH_x * sample.rate[: 4 * n]).sum() + np.abs(dH_d * sample.rate[4 * n + 1 :]).sum()
        assert abs(rate - (-sample.P_D + sample.P_X + sample.tau_e @ sample.rate[:n])) <= RELATIVE * scale
