"""A scenario is resolved ten thousand times in a campaign: what hangs on the robot is made once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from passiflex.errors import ScenarioError
from passiflex.robots.recursions import Recursions
from passiflex.simulation import Scenario, parse_scenario, resolve
from passiflex.simulation import resolve as exported
from passiflex.studies import shipped_scenario
from worlds import world


@pytest.mark.parametrize("name", ["fig1", "fig1_sampled", "fig3"])
def test_another_sample_builds_no_robot_and_parses_no_text(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = shipped_scenario(name)
    first = resolve(scenario)

    def never(*_: object) -> Any:
        raise AssertionError("made again")

    monkeypatch.setattr(Recursions, "moved", never)
    monkeypatch.setitem(exported.__globals__, "parse_scenario", never)
    other = scenario.model_copy(update={"deviations": {"link_inertia": 0.1}, "seed": 7})
    again = resolve(other)
    assert again.law.robot is first.law.robot
    assert again.seed == 7
    np.testing.assert_array_equal(resolve(scenario).plant, first.plant)
    assert np.abs(again.plant - first.plant).max() > 0.1


def test_a_changed_copy_is_taken_as_if_it_were_written() -> None:
    changes = {
        "duration": "200 ms",
        "posture": np.array([0.4, 0.7]),
        "model_errors": {"joint_stiffness": "20 %"},
    }
    copy = resolve(world().model_copy(update=changes))
    written = resolve(world(**changes))
    assert copy.text == written.text
    np.testing.assert_array_equal(copy.numbers, written.numbers)


@pytest.mark.filterwarnings("ignore:Pydantic serializer warnings")
@pytest.mark.parametrize(
    ("update", "line"),
    [
        ({"duration": -1.0}, r"duration: expected s, one number, > 0; got -1.0 \(too small\)"),
        ({"name": 3}, "name: expected text; got 3; try quotes around it"),
        ({"deviations": {"joint_stifness": 0.1}}, "deviations.joint_stifness: unknown name; try 'joint_stiffness'"),
        ({"deviations": {"link_inertia": [0, -1]}}, r"deviations.link_inertia: expected .*> -1; got \[0, -1\]"),
        ({"output_interval": 0.0015}, "output_interval: needs a whole multiple of the period, 0.001 s; got 0.0015 s"),
    ],
)  # fmt: skip
def test_what_was_made_without_checks_is_refused_at_its_place_in_the_text(
    update: dict[str, Any], line: str
) -> None:
    copy = Scenario.model_construct(**dict(world()) | update)
    with pytest.raises(
        ScenarioError, match=rf"^scenario .*: 1 mistake\n  line \d+, column \d+, {line}"
    ) as ours:
        resolve(copy)
    with pytest.raises(ScenarioError) as theirs:
        parse_scenario(copy.to_yaml(), source=f"scenario {copy.name!r}")
    assert str(ours.value) == str(theirs.value)
