"""Tables with more gains than are judged each: the one row that does not hold is found wherever it hides."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from ladders import ladder
from passiflex.problems.problem import GainChange, SampledProblem, require_sampled
from passiflex.simulation import parse_scenario, resolve
from passiflex.stability import many_gains
from passiflex.stability.judgement import holds, judge
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.many_gains import FEW, NEAREST, extremes, judged_gains
from worlds import world

Array = Any
IIWA = """\
name: iiwa
robot: iiwa14
posture: [0, 0.5, 0, -1.4, 0, 1.2, 0]
law:
  type: impedance
  task: pose
  gravity: robot
  shaped_stiffness: {ratio: 1}
  shaped_inertia: {ratio: 0.3}
  stiffness: {translation: 400, rotation: 30}
  damping: {translation: 60, rotation: 5}
control: {rate: 1000, delay: 1 ms}
duration: 1
"""
KINDS: dict[str, Any] = {
    "late": lambda: resolve(world(control={"delay": 1e-3}, law={"shaped_inertia": {"ratio": 0.3}})),
    "slow clock": lambda: resolve(
        world(
            control={"rate": 250, "delay": 4e-3, "jitter": 1e-3},
            law={
                "shaped_inertia": {"ratio": 1},
                "stiffness": {"translation": 50},
                "damping": {"translation": 10},
            },
            output_interval=4e-3,
        )
    ),
    "weight": lambda: resolve(
        world(control={"delay": 1e-3}, law={"gravity": "static"}, payload={"mass": 0.5}, tank={"initial": 2})
    ),
    "matched": lambda: resolve(
        world(
            control={"delay": 1e-3, "inner_loop": "matched", "external_torque": "observer"},
            sensors={"velocity": "differences"},
        )
    ),
    "drifting": lambda: resolve(
        world(posture=[0.4, 0.7, 0.5], law={"regularisation": 1e-6, "null_space_damping": 0.0}, reference=[]),
        ladder("yyy"),
    ),
    "pose": lambda: resolve(parse_scenario(IIWA)),
    "free axis": lambda: resolve(
        parse_scenario(
            IIWA.replace("rotation: 30", "rotation: [30, 30, 0]").replace(
                "rotation: 5", "rotation: [5, 5, 0]"
            )
        )
    ),
}


def with_gains(problem: SampledProblem, gains: list[tuple[Array, Array]]) -> SampledProblem:
    changes = tuple(GainChange(0.01 * i, 0.01 * i, K, D) for i, (K, D) in enumerate(gains))
    return dataclasses.replace(problem, gain_changes=changes)


def drawn(own: Array, spread: float, rng: np.random.Generator, *, full: bool) -> Array:
    """Return a random matrix, positive definite where the own one is, of about the same size."""
    root, free = np.sqrt(np.diag(own)), np.diag(own) == 0
    shape = np.diag(np.exp(rng.normal(0, spread, len(own))))
    if full:
        A = rng.normal(size=own.shape)
        A[free], A[:, free] = 0, 0
        shape = np.linalg.qr(A + np.diag(1e-9 * free))[0]
        shape = shape @ np.diag(np.exp(rng.normal(0, spread, len(own)))) @ shape.T
    return np.exp(rng.normal(0, 1)) * root[:, None] * shape * root


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_one_row_that_does_not_hold_is_found_among_many_that_do(kind: str, full: bool) -> None:
    """And what decides is the very row that would, were each of them judged."""
    problem, rng = require_sampled(KINDS[kind]()), np.random.default_rng(3)
    gains, loop = problem.law.layout.unpack(problem.gains), LinearLoop(problem)
    late = problem.delay + problem.jitter
    good, bad = [], []
    for _ in range(300):
        pair = tuple(drawn(gains[name], 1.0, rng, full=full) for name in ("stiffness", "damping"))
        sizes = [
            loop.radius(delay=d, gains=dict(zip(("stiffness", "damping"), pair, strict=True)))
            for d in sorted({problem.delay, late})
        ]
        (good if max(sizes) < 1 else bad).append((max(sizes), pair))
    assert len(good) > 2 * FEW
    assert bad
    alone = with_gains(problem, [pair for _, pair in good])
    judged = len(judged_gains(LinearLoop(alone), problem.delay))
    assert judged == len(good) if kind == "matched" else judged <= 2 * NEAREST
    assert judge(alone).spectrum.radius == pytest.approx(
        max(loop.radius(), *(size for size, _ in good)), abs=1e-9
    )
    bad.sort(key=lambda found: found[0])
    for size, pair in (bad[0], bad[len(bad) // 2], bad[-1]):
        rows = [pair for _, pair in good]
        rows.insert(int(rng.integers(1, len(rows))), pair)
        told = with_gains(problem, rows)
        found = judge(told)
        assert not found.stable
        assert found.part == "gains"
        assert found.spectrum.radius == pytest.approx(size, abs=1e-9)
        assert not holds(told)


def test_a_law_that_is_not_linear_in_its_gains_has_each_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = require_sampled(resolve(world()))
    told = with_gains(problem, [((200 + i) * np.eye(3), 40 * np.eye(3)) for i in range(FEW + 5)])
    assert len(judged_gains(LinearLoop(told), problem.delay)) <= 2 * NEAREST
    true = many_gains._map

    def bent(loop: LinearLoop, delay: float, numbers: Array) -> Array:
        return true(loop, delay, numbers + 1e-3 * numbers**2)

    monkeypatch.setattr(many_gains, "_map", bent)
    assert len(judged_gains(LinearLoop(told), problem.delay)) == FEW + 5


def test_of_more_than_can_be_looked_at_the_extremes_of_each_entry_are_kept() -> None:
    rng = np.random.default_rng(0)
    changes = []
    for i in range(300):
        A, B = rng.normal(size=(2, 3, 3))
        changes.append(GainChange(i, i, A @ A.T, B @ B.T))
    kept = extremes(changes, 60)
    assert 55 <= len(kept) <= 60
    assert kept[0] is changes[0]
    assert kept[-1] is changes[-1]
    for name in ("stiffness", "damping"):
        all_of, of_kept = (np.array([getattr(c, name) for c in cs]) for cs in (changes, kept))
        np.testing.assert_array_equal(all_of.min(axis=0), of_kept.min(axis=0))
        np.testing.assert_array_equal(all_of.max(axis=0), of_kept.max(axis=0))
    assert extremes(changes, 300) == tuple(changes)
