"""Wrenches over time: the sum of those that act, at a cost that grows as their number."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from passiflex.control.motion import Pose
from passiflex.problems.timeline import timeline
from passiflex.scenarios.forces import Force
from passiflex.simulation import Scenario, parse_scenario
from work import calls
from worlds import PLANAR

HOME = Pose(np.zeros(3), np.eye(3))
INSTANTS = st.integers(0, 12).map(lambda k: k / 16)
VECTORS = st.tuples(*[st.floats(-1e3, 1e3)] * 3)


def with_forces(forces: list[Force]) -> Scenario:
    return parse_scenario(PLANAR).model_copy(
        update={"forces": tuple(forces), "reference": (), "duration": 0.75}
    )


@given(st.lists(st.tuples(INSTANTS, INSTANTS, VECTORS, VECTORS), max_size=8))
def test_at_each_instant_the_wrench_is_the_sum_of_those_that_act(written: list) -> None:
    spans = [(min(a, b), max(a, b) + 0.1, f, m) for a, b, f, m in written if min(a, b) < 0.75]
    forces = [Force(start=a, end=b, force=f, moment=m) for a, b, f, m in spans]
    events = timeline(with_forces(forces), HOME)
    for event in events:
        acting = [(*f.force, *f.moment) for f in forces if f.start <= event.time < f.end]
        exact = [float(sum((Fraction(w[i]) for w in acting), Fraction(0))) for i in range(6)]
        np.testing.assert_array_equal(event.F_e, exact)
    changes = {0.0, *(t for f in forces for t in (f.start, f.end) if t < 0.75)}
    assert [event.time for event in events] == sorted(changes)


def test_the_work_grows_as_the_number_of_forces() -> None:
    """All of them overlap; four times as many are four times the calls, not sixteen."""

    def taken(number: int) -> int:
        starts = 0.5 * np.arange(number) / number
        forces = [Force(start=start, end=0.7, force=(1.0, 0.1, 0.0)) for start in starts]
        scenario = with_forces(forces)
        return calls(lambda: timeline(scenario, HOME))

    assert taken(1000) < 5 * taken(250)
