"""A margin is the law's: whether the arm would be within a wall, a little beside its start, is no part of it."""

from __future__ import annotations

import numpy as np
import pytest

from passiflex.limits.own_margin import own_margin
from passiflex.problems.free_space import in_free_space
from passiflex.problems.problem import require_sampled
from passiflex.simulation import resolve
from passiflex.stability.linear_loop import LinearLoop
from worlds import world

WALL = {"kind": "plane", "point": [0, 0, -0.01], "normal": [0, 0, 1], "relative": True, "stiffness": 1e5}
STOPS = {"kind": "end_stops", "lower": [0.45, -3], "upper": [0.55, 3]}


@pytest.mark.parametrize("around", [WALL, STOPS])
def test_what_is_around_takes_nothing_from_the_margin(around: dict[str, object]) -> None:
    beside, alone = (require_sampled(resolve(world(environment=e))) for e in ([around], []))
    np.testing.assert_array_equal(LinearLoop(in_free_space(beside)).matrix(), LinearLoop(alone).matrix())
    assert own_margin(beside) == own_margin(alone)
    assert in_free_space(alone) is alone
