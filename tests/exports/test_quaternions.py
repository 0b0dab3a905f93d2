"""Quaternions of a turning body follow the closed form through whole turns, and never change their side."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from passiflex.exports.quaternions import quaternions
from passiflex.exports.ros2_topics import topics_of
from passiflex.exports.signals import signals_of
from passiflex.simulation import Run


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (0.6, 0, -0.8)])
@pytest.mark.parametrize("start", [0.0, np.pi, 3.0])
def test_a_turn_about_a_fixed_axis_is_its_closed_form(axis: tuple[float, ...], start: float) -> None:
    """q = (n sin φ/2, cos φ/2), which needs two whole turns to come back; ±q are the same rotation."""
    angle = start + np.linspace(0, 4 * np.pi, 500)
    turns = quaternions(Rotation.from_rotvec(angle[:, None] * np.array(axis)).as_matrix())
    expected = np.column_stack([np.sin(angle / 2)[:, None] * np.array(axis), np.cos(angle / 2)])
    side = np.sign(turns[0] @ expected[0])
    np.testing.assert_allclose(turns, side * expected, atol=1e-12)


def test_small_turns_around_a_tool_that_points_down_are_small_steps() -> None:
    rng = np.random.default_rng(3)
    shaking = Rotation.from_rotvec(rng.normal(0, 0.01, (1000, 3))) * Rotation.from_rotvec([np.pi, 0, 0])
    turns = quaternions(shaking.as_matrix())
    assert (np.einsum("ij,ij->i", turns[1:], turns[:-1]) > 0.99).all()
    np.testing.assert_allclose(Rotation.from_quat(turns).as_matrix(), shaking.as_matrix(), atol=1e-12)
    for beside in (turns[0], -turns[0]):
        assert quaternions(shaking.as_matrix(), beside)[0] @ beside > 0


def test_end_effector_and_reference_are_on_one_side(run: Run) -> None:
    data = run.data.copy(deep=True)
    count = data.sizes["time"]
    swing = np.pi + 0.02 * np.cos(np.linspace(0, 20, count))
    for name, angle in (
        ("rotation", swing),
        ("desired_rotation", 2 * np.pi - swing),
        ("governed_rotation", swing),
    ):
        data[name][:] = Rotation.from_rotvec(angle[:, None] * [0, 1, 0]).as_matrix()
    data["rotation"][5:9] = np.nan
    time = [int(t * 1e9) for t in run.time]
    topics = {topic.name: topic for topic in topics_of(None, list(signals_of(Run(data))), time)}
    curves = []
    for name in ("/end_effector", "/reference", "/governed_reference"):
        found = [message for row in range(count) if (message := topics[name].message(row)) is not None]
        curves.append(np.array([[m["pose"]["orientation"][axis] for axis in "xyzw"] for m in found]))
    assert [len(curve) for curve in curves] == [count - 4, count, count]
    everything = np.concatenate(curves)
    assert (everything @ everything[0] > 0.99).all()
