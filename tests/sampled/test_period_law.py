"""The law of a period by itself, as a robot or another engine calls it, against the period of the native loop."""

from __future__ import annotations

import numpy as np
import pytest

from passiflex.native import NativeFunction
from passiflex.problems.problem import SampledProblem
from passiflex.simulation import resolve
from worlds import world

KINDS = {
    "plain": {},
    "matched": {"control": {"inner_loop": "matched", "external_torque": "observer"}},
    "rough": {
        "sensors": {"velocity": "differences", "link_resolution": 1e-4},
        "motors": {"coulomb_friction": 2, "torque_limit": "robot"},
        "drags": [{"from": 0.0, "to": 9.0, "viscous": 3, "dry": 0.2}],
        "noise": {"torque_variance": 0.01, "hold": 0.001},
    },
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_measured_and_the_law_make_a_period(kind: str) -> None:
    """With `sense` before it, `law` is `control` to round-off, from memory to memory; it has no number of the plant."""
    problem = resolve(world(**KINDS[kind]))
    assert isinstance(problem, SampledProblem)
    loop, rng = problem.loop, np.random.default_rng(1)
    sense, law, control = (
        NativeFunction(loop.sense),
        NativeFunction(loop.law_alone),
        NativeFunction(loop.control),
    )
    felt, own = loop.plant.environment.size, loop.plant.parameters.size
    assert law.inputs[2].size == loop.row.size - felt
    assert law.inputs[3].size == problem.numbers.size - own
    row = loop.row.pack(loop.row.zeros() | {
        "desired_rotation": np.eye(3), "desired_position": problem.home.position + 0.01,
        "desired_stiffness": 200 * np.eye(3), "desired_damping": 40 * np.eye(3), "elapsed": problem.period,
    })  # fmt: skip
    memory = apart = loop.memory.pack(loop.memory.zeros())
    for _ in range(5):
        x = loop.plant.at_rest(problem.q, problem.theta, problem.home) + 1e-3 * rng.normal(
            size=loop.plant.state.size
        )
        row[:felt] = rng.uniform(0, 2, felt)
        measured = sense(x, row[:felt], problem.plant)
        memory, *said = control(x, memory, row, problem.numbers)
        apart, *told = law(measured, apart, row[felt:], problem.numbers[own:])
        for one, other in zip((memory, *said), (apart, *told), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-11)
