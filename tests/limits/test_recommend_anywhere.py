"""What `recommend` returns is a piece of a scenario that `limits` and `simulate` accept, on any arm and at any rate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from ladders import ladder
from passiflex.limits import check, recommend
from passiflex.limits.margin_box import MarginBox
from passiflex.simulation import parse_scenario, resolve, simulate_problem

REAL = {
    "link_resolution": 1.7e-4,
    "motor_resolution": 1.7e-6,
    "velocity": "differences",
    "velocity_filter": 200,
}
CASES: list[Any] = [
    pytest.param("y", "position", "robot", 100.0, 0, {}, id="1-100Hz"),
    pytest.param("yy", "position", "static", 4000.0, 2, REAL, id="2-4kHz"),
    pytest.param("zyy", "position", "motor", 500.0, 1, REAL, id="3-500Hz"),
    pytest.param("zyyx", "position", "robot", 500.0, 1, {}, id="4-free"),
    pytest.param("zyyxy", "position", "static", 1000.0, 0, REAL, id="5-free"),
    pytest.param("zyyxyx", "pose", "robot", 500.0, 1, REAL, id="6-pose"),
    pytest.param("zyyxyxz", "pose", "motor", 1000.0, 1, REAL, id="7-pose"),
    pytest.param("zyyxyxzy", "pose", "static", 2000.0, 2, {}, id="8-pose"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("axes", "task", "gravity", "rate", "periods", "sensors"), CASES)
def test_it_is_accepted_and_holds_on_its_box(
    axes: str, task: str, gravity: str, rate: float, periods: int, sensors: dict[str, Any]
) -> None:
    arm = ladder(axes)
    gains = (
        {"stiffness": 100.0, "damping": 20.0} if task == "position" else {"stiffness": 40.0, "damping": 12.0}
    )
    if (
        gravity != "robot"
    ):  # the weight is off by the margin as well, and a soft spring falls away under the rest
        gains = {name: 6 * value for name, value in gains.items()}
    # With `motor` a stretched arm falls away whatever the gains are.
    bent = [[0.3, 0.6, 1.2], [-0.5, 0.9, 1.0]] if axes == "zyy" else None
    found = recommend(
        arm, rate, periods / rate, 0.1, task=task, gravity=gravity, sensors=sensors, postures=bent, **gains
    )
    base = {"name": "pasted", "robot": arm.name, "tank": {"kind": "port"}, "duration": 20 / rate}
    problems = []
    for q in found.postures:
        text = yaml.safe_dump(base | yaml.safe_load(found.snippet) | {"posture": q.tolist()})
        problem = resolve(parse_scenario(text), arm)
        assert check(problem).stable
        assert simulate_problem(problem).failure == ""
        problems.append(problem)
    box = MarginBox(tuple(problems), 0.1)
    radii = [box.radius(m, {}) for i in range(len(problems)) for m in box.drawn(i, 20, seed=5)]
    assert np.max(radii) < 1
