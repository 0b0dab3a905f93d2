"""Entries that had another name in earlier versions are still read by it, wherever an entry is named."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from passiflex.campaigns.target import complete_data, locate
from passiflex.errors import ScenarioError
from passiflex.simulation import Scenario, parse_scenario
from worlds import PLAIN, merged

CHANGE = {"at": 0.1, "duration": 0.1, "stiffness": {"translation": 80}}
DRAG = {"from": 0.1, "to": 0.2, "viscous": 3, "dry": 2}
NEW = {
    "control": {"allow_unstable": True},
    "gain_changes": [CHANGE],
    "environment": [{"kind": "drag"} | DRAG],
}
FORMER = {"control": {"insist": True}, "gains": [CHANGE], "drags": [DRAG]}


def text(changes: dict[str, Any]) -> str:
    return yaml.safe_dump(merged(yaml.safe_load(PLAIN), changes), sort_keys=False)


@pytest.mark.parametrize("name", FORMER)
def test_a_former_name_reads_as_the_new_one(name: str) -> None:
    new = dict(zip(FORMER, NEW.items(), strict=True))[name]
    assert parse_scenario(text({name: FORMER[name]})) == parse_scenario(text(dict([new])))


def test_what_is_written_has_the_new_names() -> None:
    written = yaml.safe_load(parse_scenario(text(FORMER)).to_yaml())
    assert not {"gains", "drags"} & set(written)
    assert "insist" not in written["control"]
    assert parse_scenario(yaml.safe_dump(written)) == parse_scenario(text(NEW))
    assert Scenario.model_validate(written) == parse_scenario(text(NEW))


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"control": {"insist": 1}}, "control.insist: expected true or false; got 1"),
        ({"gains": [CHANGE | {"duration": -1}]}, "gains[0].duration: expected s, one number, ≥ 0; got -1"),
        ({"gains": [CHANGE | {"durration": 1}]}, "gains[0].durration: unknown name; try 'duration'"),
        ({"drags": [DRAG | {"viscous": "3 kg"}]}, "drags[0].viscous: expected N s/m, one number, ≥ 0; got '3 kg'"),
        ({"drags": [DRAG | {"dri": 3}]}, "drags[0].dri: unknown name; try 'dry'"),
        ({"drags": [DRAG | {"kind": "wall"}]}, "drags[0].kind: unknown word 'wall'"),
        ({"drags": 3}, "drags: expected a list; got 3"),
        ({"gain_changes": [CHANGE], "gains": [CHANGE]}, "gains: is 'gain_changes', which is there too; remove one"),
        ({"environment": [DRAG]}, "environment[0].kind: missing: "),
    ],
)  # fmt: skip
def test_a_mistake_is_told_by_the_name_that_is_written(changes: dict[str, Any], where: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        parse_scenario(text(changes))
    assert any(f", {where}" in line for line in str(refused.value).splitlines()), str(refused.value)


@pytest.mark.parametrize(
    ("former", "new"),
    [
        ("control.insist", "control.allow_unstable"),
        ("gains.1.duration", "gain_changes.1.duration"),
        ("drags.1.viscous", "environment.1.viscous"),
    ],
)
def test_a_campaign_varies_it_by_either_name(former: str, new: str) -> None:
    data = complete_data(parse_scenario(text(NEW)))
    assert locate(data, former) == locate(data, new)


@pytest.mark.parametrize(
    ("former", "new"),
    [
        ({"control.insist": True}, {"control.allow_unstable": True}),
        ({"control": {"insist": True}}, {"control": {"allow_unstable": True}}),
        ({"gains": [CHANGE]}, {"gain_changes": [CHANGE]}),
        ({"drags": [DRAG]}, {"environment": [{"kind": "drag"} | DRAG]}),
    ],
)
def test_a_change_by_a_former_name(former: dict[str, Any], new: dict[str, Any]) -> None:
    scenario = parse_scenario(PLAIN)
    assert scenario.changed(former) == scenario.changed(new) != scenario


def test_an_entry_of_a_list_is_changed_by_the_former_name() -> None:
    scenario = parse_scenario(text(FORMER))
    assert scenario.changed({"drags[0].dry": 5}).environment[0].dry == 5
    assert scenario.changed({"gains[0].duration": 0.2}).gain_changes[0].duration == 0.2
