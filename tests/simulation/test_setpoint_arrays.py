"""Set-points from arrays are the table that a file with their numbers is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import passiflex as pf
from passiflex.errors import PassiflexError, ScenarioError, SizeError, ValueRangeError
from passiflex.scenarios.reference import Step
from passiflex.simulation import parse_scenario
from worlds import same, world

T = np.array([0.0, 0.1, 0.3])
PLACES = np.array([[0, 0, 0], [0.01, 0, 0.02], [0.03, 0, 0]])


def test_arrays_are_the_rows_of_a_file_and_the_run_can_be_made_again() -> None:
    K = np.array([[200.0, 200, 200], [250, 500, 200], [220, 400, 210]])
    given = pf.setpoint_table(T, PLACES, stiffness=K, relative=True, between="held")
    rows = "t,x,y,z,kx,ky,kz\n" + "".join(
        ",".join(map(str, row)) + "\n" for row in np.column_stack([T, PLACES, K]).tolist()
    )
    scenario = world(reference=[])
    run = pf.simulate(scenario, reference=given)
    assert run.own_parts == ""
    assert same(run, pf.simulate(world(reference={"rows": rows, "relative": True, "between": "held"})))
    assert run.scenario is not None
    assert same(pf.simulate(run.scenario), run)
    assert same(pf.simulate(scenario.changed(reference=[given])), run)
    assert parse_scenario(run.scenario.to_yaml()) == run.scenario


def test_it_goes_among_the_events_of_a_scenario() -> None:
    scenario = world(reference=[{"at": 0.4, "kind": "hold"}])
    run = pf.simulate(scenario, reference=[pf.setpoint_table(T, PLACES, at=0.05, relative=True)])
    assert run.scenario is not None
    assert [event.kind for event in run.scenario.reference] == ["table", "hold"]
    with pytest.raises(
        ScenarioError, match=r"reference\[1\]\.at: needs to be later than the one before, 0.4 s"
    ):
        pf.simulate(scenario, reference=[pf.setpoint_table(T, PLACES, at=0.4, relative=True)])


def test_an_event_alone_is_a_list_of_one() -> None:
    step = Step(at=0.1, kind="step", by=(0.0, 0.0, 0.02))
    scenario = world(reference=[])
    assert same(pf.simulate(scenario, reference=step), pf.simulate(scenario, reference=[step]))


@pytest.mark.parametrize("form", ["vectors", "quaternions", "matrices", "rotations"])
def test_orientations_in_every_form(form: str) -> None:
    turn = Rotation.from_rotvec(np.random.default_rng(0).normal(size=(3, 3)))
    forms: dict[str, Any] = {
        "vectors": turn.as_rotvec(),
        "quaternions": turn.as_quat(),
        "matrices": turn.as_matrix(),
        "rotations": turn,
    }
    table = pf.setpoint_table(T, rotation=forms[form])
    assert table.numbers.turn is not None
    np.testing.assert_allclose(
        Rotation.from_quat(table.numbers.turn).as_matrix(), turn.as_matrix(), rtol=0, atol=1e-14
    )


@pytest.mark.parametrize(
    ("arguments", "kind", "said"),
    [
        ({"time": []}, SizeError, "time; got shape (0,); needs (N,)"),
        ({"time": 1.0}, SizeError, "time; got shape (); needs (N,)"),
        ({"time": ["a", "b", "c"]}, ValueRangeError, "time; got list; needs an array of numbers"),
        ({"position": PLACES.T[:2]}, SizeError, "position; got shape (2, 3); needs (3, 3)"),
        ({"rotation": np.eye(4)}, SizeError, "rotation; got shape (4, 4); needs (3, 3) or (3, 4)"),
        (
            {"rotation": np.ones((3, 3, 3))},
            ValueRangeError,
            "rotation[0] is no rotation matrix; needs R Rᵀ = I and det R = 1, to 1e-6",
        ),
        (
            {"stiffness": np.ones((3, 4))},
            SizeError,
            "stiffness; got shape (3, 4); needs (3, 3) or (3, 6) or (3, 3, 3) or (3, 6, 6)",
        ),
        (
            {"position": np.full((3, 3), np.nan)},
            ScenarioError,
            "line 2, column x: got 'nan', which is not finite",
        ),
        ({"time": [0, 0, 1]}, ScenarioError, "line 3, column t: the time repeats, 0 s after 0 s"),
        ({"between": "hold"}, ScenarioError, "between: unknown word 'hold'; try 'held'"),
        (
            {"stream": {"rate": 0}},
            ScenarioError,
            "stream.rate: expected Hz, one number, > 0; got 0 (too small)",
        ),
    ],
)
def test_what_is_no_table_is_refused(arguments: Any, kind: type[PassiflexError], said: str) -> None:
    with pytest.raises(kind) as refused:
        pf.setpoint_table(**{"time": T, "position": PLACES, **arguments})
    assert said in str(refused.value)
