"""A changed scenario is what a file with these entries would be, and what no file may say is refused."""

from __future__ import annotations

import copy
import io
import re
from typing import Any

import numpy as np
import pytest
import yaml

import passiflex as pf
from passiflex.errors import ArgumentError, FrozenError, PassiflexError, ScenarioError
from passiflex.scenarios.forces import Force
from passiflex.simulation import Scenario, parse_scenario
from worlds import PLAIN, PLANAR, merged

MATRIX = np.diag([30.0, 60, 90]).tolist()
FORCES = [{"from": 0.1, "to": 0.2, "force": [0, 0, 1]}, {"from": 0.3, "to": 0.4, "force": [0, 0, 2]}]


def text(scenario: str = PLAIN, **entries: Any) -> str:
    return yaml.safe_dump(merged(yaml.safe_load(scenario), entries))


def read(scenario: str = PLAIN, **entries: Any) -> Scenario:
    return parse_scenario(text(scenario, **entries))


@pytest.mark.parametrize(
    ("change", "entries"),
    [
        ({"duration": "200 ms"}, {"duration": 0.2}),
        ({"law.null_space_damping": 3}, {"law": {"null_space_damping": 3}}),
        ({"law": {"null_space_damping": 3}}, {"law": {"null_space_damping": 3}}),
        ({"law.stiffness.translation": "50 N/m"}, {"law": {"stiffness": {"translation": 50}}}),
        ({"law": {"stiffness": {"translation": [1, 2, 3]}}}, {"law": {"stiffness": {"translation": [1, 2, 3]}}}),
        ({"law.shaped_inertia.ratio": 0.4}, {"law": {"shaped_inertia": {"ratio": 0.4}}}),
        ({"control.fallback.stiffness.translation": 9, "control": {"delay": "1 ms"}},
         {"control": {"delay": 0.001, "fallback": {"stiffness": {"translation": 9}}}}),
        ({"sensors": {"velocity": "differences"}}, {"sensors": {"velocity": "differences"}}),
        ({"tank.initial": 5}, {"tank": {"initial": 5}}),
        ({"forces": FORCES}, {"forces": FORCES}),
        ({}, {}),
    ],
)  # fmt: skip
def test_a_change_is_as_if_it_had_been_written(change: dict[str, Any], entries: dict[str, Any]) -> None:
    assert read().changed(change).to_yaml() == read(**entries).to_yaml()


def test_names_and_paths_may_be_given_together() -> None:
    changed = read().changed({"law.gravity": "robot"}, duration="0.3 s", seed=4)
    assert changed.to_yaml() == read(law={"gravity": "robot"}, duration=0.3, seed=4).to_yaml()


def test_an_entry_of_a_list_is_changed_by_its_number() -> None:
    changed = read(forces=FORCES).changed({"forces[1].force": [0, 0, 7], "forces[1].to": "450 ms"})
    last = {"from": 0.3, "to": 0.45, "force": [0, 0, 7]}
    assert changed.to_yaml() == read(forces=[FORCES[0], last]).to_yaml()


@pytest.mark.parametrize(
    ("before", "change", "after"),
    [
        ({"stiffness": {"translation": 60}}, {"stiffness.matrix": MATRIX}, {"stiffness": {"matrix": MATRIX}}),
        ({"stiffness": {"matrix": MATRIX}}, {"stiffness.translation": 5}, {"stiffness": {"translation": 5}}),
        ({"damping": {"translation": 20}}, {"damping": {"ratio": 0.7}}, {"damping": {"ratio": 0.7}}),
        ({"shaped_inertia": {"ratio": 0.3}}, {"shaped_inertia": "2 kg m^2"}, {"shaped_inertia": 2}),
        ({"shaped_inertia": {"ratio": 0.3}}, {"shaped_inertia.value": 2}, {"shaped_inertia": 2}),
        ({"shaped_inertia": 2}, {"shaped_inertia": {"ratio": 0.3}}, {"shaped_inertia": {"ratio": 0.3}}),
    ],
)
def test_another_way_of_writing_takes_the_place_of_the_one_that_is_there(
    before: dict[str, Any], change: dict[str, Any], after: dict[str, Any]
) -> None:
    def of(law: dict[str, Any]) -> dict[str, Any]:
        data = yaml.safe_load(PLAIN)
        return data | {"law": data["law"] | law}

    changed = parse_scenario(yaml.safe_dump(of(before))).law.changed(change)
    assert changed == parse_scenario(yaml.safe_dump(of(after))).law


def test_another_law_is_written_whole() -> None:
    rigid = {"type": "rigid", "task": "position", "stiffness": {"translation": 60},
             "damping": {"translation": 20}, "target_inertia": {"translation": 2}}  # fmt: skip
    law = read(PLANAR).changed({"law": rigid, "tank": None}).law
    assert law == parse_scenario(yaml.safe_dump(yaml.safe_load(PLANAR) | {"law": rigid})).law


def test_what_was_left_out_goes_along_with_what_is_changed() -> None:
    """Kind and floor of the tank go by the clock, the interval of the rows by the rate."""
    continuous = read(PLANAR)
    sampled = continuous.changed({"control.rate": "300 Hz", "tank.initial": 3, "output_interval": None})
    assert sampled.tank is not None
    assert (sampled.tank.kind, sampled.tank.floor, sampled.tank.initial) == ("port", 0.1, 3)
    assert sampled.output_interval * 300 == pytest.approx(round(sampled.output_interval * 300), abs=1e-9)
    back = sampled.changed(control=None)
    assert back.tank is not None
    assert (back.tank.kind, back.tank.floor) == ("paper", 0.01)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"durration": 1}, "durration: unknown name; try 'duration'"),
        ({"law.stifness.translation": 5}, "law.stifness: unknown name; try 'stiffness'"),
        ({"law": {"gravitty": "robot"}}, "law.gravitty: unknown name; try 'gravity'"),
        ({"law.gravity": "robott"}, "law.gravity: unknown word 'robott'; try 'robot'"),
        ({"duration": -1}, "duration: expected s, one number, > 0; got -1 (too small)"),
        ({"duration": "3 m"}, "duration: expected s, one number, > 0; got '3 m' (m)"),
        ({"duration.x": 1}, "duration: expected s, one number, > 0; got {'x': 1} (not a quantity)"),
        ({"forces[2].to": 1}, "forces[2]: forces has entries [0] to [1]"),
        ({"environment[0].to": 1}, "environment[0]: environment has no entries"),
        ({"drags[0].to": 1}, "environment[0]: environment has no entries"),
        ({"forces.1.to": 1}, "'forces.1.to': no path; try one as 'law.gravity' or 'reference[0].at'"),
        ({"": 1}, "'': no path; try one as 'law.gravity' or 'reference[0].at'"),
    ],
)
def test_what_leads_nowhere_or_does_not_fit_is_one_line(change: dict[str, Any], line: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        read(forces=FORCES).changed(change)
    assert str(refused.value) == f"scenario 'planar', changed: 1 mistake\n  {line}"


def test_every_mistake_of_a_change_is_told() -> None:
    with pytest.raises(ScenarioError) as refused:
        read().changed({"durration": 1, "law.gravity": "robott", "seed": -3})
    assert len(refused.value.mistakes) == 3


@pytest.mark.parametrize(
    ("update", "line"),
    [
        ({"stifness": 50, "duration": 1}, "stifness: unknown name; "),
        ({"durration": 1}, "durration: unknown name; try 'duration'"),
        ({"duration": 0}, "duration: expected s, one number, > 0; got 0 (too small)"),
        ({"law.stiffness.translation": 50},
         "law.stiffness.translation: model_copy takes whole entries; try changed({'law.stiffness.translation': …})"),
    ],
)  # fmt: skip
def test_a_copy_swallows_nothing(update: dict[str, Any], line: str) -> None:
    with pytest.raises(ScenarioError, match=rf"^scenario 'planar', changed: 1 mistake\n  {re.escape(line)}"):
        read().model_copy(update=update)


def test_a_copy_takes_whole_entries_as_they_are_or_as_they_are_written() -> None:
    scenario = read(forces=FORCES)
    law = scenario.law.model_copy(update={"null_space_damping": "3 1/s"})
    assert law.null_space_damping == 3
    changed = scenario.model_copy(update={"law": law, "duration": "400 ms", "forces": FORCES[:1]})
    assert changed.to_yaml() == read(forces=FORCES[:1], law={"null_space_damping": 3}, duration=0.4).to_yaml()
    (push,) = changed.forces
    assert push.model_copy(update={"start": 0.15}) == Force.model_validate(FORCES[0] | {"from": 0.15})
    assert scenario.model_copy() == scenario
    assert scenario.model_copy(deep=True).to_yaml() == scenario.to_yaml()


def test_frozen_is_an_error_of_ours_with_what_to_do() -> None:
    scenario = copy.copy(read())
    with pytest.raises(FrozenError) as refused:
        scenario.duration = 2.0  # type: ignore[misc]
    assert isinstance(refused.value, PassiflexError)
    assert str(refused.value) == (
        "Scenario is frozen; got duration = 2.0; needs a changed copy; try changed(duration=2.0)"
    )
    with pytest.raises(FrozenError, match=r"^ImpedanceSettings is frozen; got durration = 1; "):
        scenario.law.durration = 1  # type: ignore[union-attr]
    with pytest.raises(FrozenError, match=r"got del duration; .* try changed\(duration=\.\.\.\)$"):
        del scenario.duration
    with pytest.raises(FrozenError, match=r"got del noise; .* try changed\(noise=None\)$"):
        del scenario.noise
    with pytest.raises(FrozenError, match=r"got durration = 1; .* try changed\(duration=1\)$"):
        scenario.durration = 1  # type: ignore[attr-defined]
    with pytest.raises(FrozenError, match=r"got foo = 1; .* try changed, with one of its own names$"):
        scenario.foo = 1  # type: ignore[attr-defined]
    assert scenario == read()


@pytest.mark.parametrize("given", [None, "duration", [1], 5, b"x", object()])
def test_a_change_that_is_no_mapping_is_refused(given: Any) -> None:
    with pytest.raises(ArgumentError, match=r"needs a mapping; try changed\("):
        read().changed(given)
    if given is not None:  # as everywhere in pydantic, nothing is to be changed then
        with pytest.raises(ArgumentError, match=r"needs a mapping; try model_copy\("):
            read().model_copy(update=given)


@pytest.mark.parametrize("given", [5, "x", io.StringIO(), [1], b"x"])
def test_a_section_that_is_none_is_refused_at_its_place(given: Any) -> None:
    with pytest.raises(ScenarioError, match=r"law: "):
        read().changed(law=given)


def test_a_mapping_is_a_scenario() -> None:
    data = yaml.safe_load(text(duration=0.15))
    run = pf.simulate(data)
    np.testing.assert_array_equal(run["q"], pf.simulate(parse_scenario(yaml.safe_dump(data)))["q"])
    assert pf.check(data).sentence == pf.check(read(duration=0.15)).sentence


def test_the_mistakes_of_a_mapping_are_told_by_their_places() -> None:
    data = yaml.safe_load(text()) | {"durration": 1, "posture": [0.5, "eight"]}
    with pytest.raises(ScenarioError) as refused:
        pf.simulate(data)
    assert refused.value.mistakes == [
        "posture: expected rad, a list of numbers; got [0.5, 'eight'] (not a number with a unit)",
        "durration: unknown name; try 'duration'",
    ]
