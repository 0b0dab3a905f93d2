"""The governor: exact when the budget suffices, affordable when it does not, and what it says it costs."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import NamedTuple

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from loops import SEEDS, definite, rotation
from passiflex.control import AbstractTask, PoseTask, PositionTask
from passiflex.robots.arm import EndEffectorPose
from passiflex.sampled.governor import HALVINGS, govern_pose, govern_stiffness

TASKS = (PoseTask(), PositionTask())
SHARES = st.floats(0, 1)
BOUNDS = st.floats(0, 300)
FINEST = 2.0**-HALVINGS
EXACT = 1e-12
"""Of the largest potential on the way: dozens of terms, each rounded to 1e-16."""
TINY = 1e-300
"""Numbers that small have no 16 digits."""
ORTHONORMAL = 1e-9

each_task = pytest.mark.parametrize("task", TASKS, ids=lambda t: type(t).__name__)
accounting = pytest.mark.parametrize("signed", [0.0, 1.0], ids=["paper", "signed"])


class Change(NamedTuple):
    """Where the end effector is, what is in force, and what is wanted."""

    pose: EndEffectorPose
    held: EndEffectorPose
    wanted: EndEffectorPose
    stiffness: np.ndarray
    stiffer: np.ndarray


def change(task: AbstractTask, seed: int) -> Change:
    rng = np.random.default_rng(seed)
    poses = [EndEffectorPose(rng.normal(size=3) / 2, rotation(rng)) for _ in range(3)]
    return Change(*poses, definite(rng, task.size, 1, 300), definite(rng, task.size, 1, 300))


@lru_cache
def functions(task: AbstractTask) -> tuple[cs.Function, cs.Function, cs.Function]:
    poses = [EndEffectorPose(cs.SX.sym(f"p{i}", 3), cs.SX.sym(f"R{i}", 3, 3)) for i in range(3)]
    held, wanted = cs.SX.sym("K_held", task.size, task.size), cs.SX.sym("K", task.size, task.size)
    budget, signed = cs.SX.sym("budget"), cs.SX.sym("signed")
    pose = govern_pose(task, *poses, held, budget, signed)
    spring = govern_stiffness(task, *poses[:2], held, wanted, budget, signed)
    symbols = [x for pose in poses for x in pose]
    return (
        cs.Function("pose", [*symbols, held, budget, signed], [*pose.value, pose.share, pose.cost]),
        cs.Function("spring", [*symbols[:4], held, wanted, budget, signed], list(spring)),
        cs.Function("U", [*symbols[:4], held], [task.potential(*poses[:2], held)]),
    )


def moved(task: AbstractTask, c: Change, budget: float, signed: float) -> SimpleNamespace:
    """Return what is granted of a new pose, and ΔU at it."""
    out = functions(task)[0](*c.pose, *c.held, *c.wanted, c.stiffness, budget, signed)
    position, axes, share, cost = (np.array(x) for x in out)
    value = EndEffectorPose(position.ravel(), axes)
    before, after = (potential(task, c.pose, at, c.stiffness) for at in (c.held, value))
    scale = max(before, after, potential(task, c.pose, c.wanted, c.stiffness))
    return SimpleNamespace(
        value=value, share=share.item(), cost=cost.item(), stored=after - before, scale=scale
    )


def stiffened(task: AbstractTask, c: Change, budget: float, signed: float) -> SimpleNamespace:
    """Return what is granted of a new stiffness, and ΔU with it."""
    value, share, cost = functions(task)[1](*c.pose, *c.held, c.stiffness, c.stiffer, budget, signed)
    before, after, wanted = (
        potential(task, c.pose, c.held, K) for K in (c.stiffness, np.array(value), c.stiffer)
    )
    scale = max(before, after, wanted)
    return SimpleNamespace(
        value=np.array(value), share=float(share), cost=float(cost), stored=after - before, scale=scale
    )


def potential(task: AbstractTask, pose: EndEffectorPose, reference: EndEffectorPose, K: np.ndarray) -> float:
    return float(functions(task)[2](*pose, *reference, K))


def price(cost: float, signed: float) -> float:
    return cost if signed else abs(cost)


def whole_price(task: AbstractTask, c: Change, signed: float) -> float:
    before, after = (potential(task, c.pose, at, c.stiffness) for at in (c.held, c.wanted))
    return price(after - before, signed)


def turned(axis: np.ndarray, angle: float) -> np.ndarray:
    return Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle).as_matrix()


def slack(task: AbstractTask, seed: int, angle: float) -> Change:
    """Return a change from a slack spring: its cost rises all the way, as γ² along the line."""
    c, rng = change(task, seed), np.random.default_rng(seed + 1)
    wanted = EndEffectorPose(c.wanted.position, turned(rng.normal(size=3), angle) @ c.pose.rotation)
    K = c.stiffness
    K[:3, 3:] = K[3:, :3] = 0  # with coupling it need not rise
    return c._replace(held=c.pose, wanted=wanted, stiffness=K)


@each_task
@accounting
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_what_the_budget_covers_is_granted_to_the_last_bit(
    task: AbstractTask, signed: float, seed: int
) -> None:
    c = change(task, seed)
    for budget in (1e9, max(whole_price(task, c, signed), 0)):
        granted = moved(task, c, budget * (1 + EXACT), signed)
        assert granted.share == 1
        np.testing.assert_array_equal(granted.value.position, c.wanted.position)
        np.testing.assert_array_equal(granted.value.rotation, c.wanted.rotation)
    granted = stiffened(task, c, 1e9, signed)
    assert granted.share == 1
    np.testing.assert_array_equal(granted.value, c.stiffer)


@each_task
@accounting
@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, budget=BOUNDS, part=SHARES)
def test_the_price_is_what_the_granted_change_stores_and_within_the_budget(
    task: AbstractTask, signed: float, seed: int, budget: float, part: float
) -> None:
    """For any poses, coupled stiffness and budget; |ΔU| in the paper's tank also where ΔU < 0."""
    c = change(task, seed)
    for limit in (budget, part * abs(whole_price(task, c, signed))):
        for grant in (moved, stiffened):
            granted = grant(task, c, limit, signed)
            assert granted.cost == pytest.approx(granted.stored, rel=0, abs=EXACT * granted.scale)
            assert price(granted.cost, signed) <= limit * (1 + EXACT) + TINY
            assert 0 <= granted.share <= 1


@each_task
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, part=SHARES)
def test_energy_that_a_change_gives_back_has_its_price_in_the_papers_tank(
    task: AbstractTask, seed: int, part: float
) -> None:
    """|ΔU| stays within the budget, although the change would be free in a signed tank."""
    c = slack(task, seed, 1.0)
    c = c._replace(held=c.wanted, wanted=c.held)  # back to where the spring is slack
    whole = whole_price(task, c, 0.0)
    paper, signed = moved(task, c, part * whole, 0.0), moved(task, c, 0.0, 1.0)
    assert -part * whole <= paper.cost <= 0
    assert signed.share == 1
    assert signed.cost == pytest.approx(-whole, rel=EXACT)


@each_task
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, budget=BOUNDS)
def test_granted_axes_stay_orthonormal(task: AbstractTask, seed: int, budget: float) -> None:
    """A short step from a held frame leaves its own error, and no more."""
    R = moved(task, change(task, seed), budget, 0.0).value.rotation
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=ORTHONORMAL)
    assert np.linalg.det(R) == pytest.approx(1, abs=ORTHONORMAL)


@each_task
@accounting
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, angle=st.floats(0, np.pi))
def test_without_a_budget_the_reference_stands(
    task: AbstractTask, signed: float, seed: int, angle: float
) -> None:
    c = slack(task, seed, angle)
    granted = moved(task, c, 0.0, signed)
    assert (granted.share, granted.cost) == (0, 0)
    np.testing.assert_array_equal(granted.value.position, c.held.position)
    np.testing.assert_array_equal(granted.value.rotation, c.held.rotation)
    c = change(task, seed)
    c = c._replace(stiffer=2 * c.stiffness)
    granted = stiffened(task, c, 0.0, signed)
    assert (granted.share, granted.cost) == (0, 0)
    np.testing.assert_array_equal(granted.value, c.stiffness)


@each_task
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, angle=st.floats(0.01, 3), part=st.floats(1e-3, 0.999))
def test_a_rising_cost_is_paid_up_to_the_last_halving(
    task: AbstractTask, seed: int, angle: float, part: float
) -> None:
    """The next γ of the search, 2⁻¹² further on, would cost more than the budget."""
    c = slack(task, seed, angle)
    budget = part * whole_price(task, c, 1.0)
    granted = moved(task, c, budget, 1.0)
    gamma = granted.share + FINEST
    turn = Rotation.from_matrix(c.wanted.rotation @ c.held.rotation.T).as_rotvec()
    further = EndEffectorPose(
        c.held.position + gamma * (c.wanted.position - c.held.position),
        Rotation.from_rotvec(gamma * turn).as_matrix() @ c.held.rotation,
    )
    assert granted.cost <= budget
    assert potential(task, c.pose, further, c.stiffness) >= budget * (1 - 1e-9)
    if task.size == 3:  # the cost is γ² times the whole
        assert granted.share == pytest.approx(np.sqrt(part) - FINEST / 2, abs=FINEST / 2 + 1e-9)


@each_task
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, part=st.floats(1e-3, 1))
def test_a_stiffness_is_granted_in_proportion(task: AbstractTask, seed: int, part: float) -> None:
    """U is linear in K_x: γ = budget / price, and the whole budget is used."""
    c = change(task, seed)
    c = c._replace(stiffer=c.stiffness + definite(np.random.default_rng(seed), task.size, 1, 50))
    whole = potential(task, c.pose, c.held, c.stiffer) - potential(task, c.pose, c.held, c.stiffness)
    granted = stiffened(task, c, part * whole, 1.0)
    assert granted.share == pytest.approx(part, rel=1e-9)
    assert granted.cost == pytest.approx(part * whole, rel=1e-9)
    assert np.linalg.eigvalsh(granted.value)[0] >= np.linalg.eigvalsh(c.stiffness)[0] * (1 - 1e-9)


@settings(max_examples=60, deadline=None)
@given(
    seed=SEEDS,
    short=st.one_of(st.just(0.0), st.floats(-16, -4).map(lambda e: 10.0**e)),
    part=st.floats(0.01, 1),
    along=st.booleans(),
)
def test_half_a_turn_has_an_axis(seed: int, short: float, part: float, along: bool) -> None:
    """At and near 180°, where sin ψ is nothing but round-off, the way is a rotation and no NaN."""
    rng = np.random.default_rng(seed)
    axis = np.eye(3)[rng.integers(3)] if along else rng.normal(size=3)
    c = slack(PoseTask(), seed, 1.0)
    c = c._replace(wanted=EndEffectorPose(c.held.position, turned(axis, np.pi - short) @ c.held.rotation))
    granted = moved(PoseTask(), c, part * whole_price(PoseTask(), c, 1.0), 1.0)
    R = granted.value.rotation
    assert granted.share > 0
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=ORTHONORMAL)
    way = Rotation.from_matrix(R @ c.held.rotation.T).magnitude()
    assert way == pytest.approx(granted.share * (np.pi - short), abs=1e-7)
    assert granted.cost == pytest.approx(granted.stored, abs=EXACT * granted.scale)


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-3, 2.0, np.pi])
def test_a_reference_arrives_in_many_small_steps(angle: float) -> None:
    """As the budget of a period allows, without a drift off the rotations, and at the wanted pose to the last bit."""
    c = slack(PoseTask(), 3, angle)
    budget = whole_price(PoseTask(), c, 1.0) / 500
    for _ in range(600):
        granted = moved(PoseTask(), c, budget, 1.0)
        c = c._replace(held=granted.value)
        np.testing.assert_allclose(c.held.rotation.T @ c.held.rotation, np.eye(3), atol=1e-13)
    np.testing.assert_array_equal(c.held.position, c.wanted.position)
    np.testing.assert_array_equal(c.held.rotation, c.wanted.rotation)
