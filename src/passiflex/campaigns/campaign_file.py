"""Campaign files: YAML to `Campaign`, with every mistake at its line and column, all at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from passiflex.campaigns.campaign import Campaign
from passiflex.errors import ScenarioError
from passiflex.files import as_path
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.scenario_file import load_scenario, read_scenario, read_text, read_tree
from passiflex.texts.model_mistakes import explained
from passiflex.texts.quantity import shown
from passiflex.texts.yaml_tree import Tree

A_CAMPAIGN = "a campaign needs at least name, scenario and samples"


def load_campaign(path: str | Path) -> Campaign:
    """Return the campaign of a file; its scenario file is found relative to it.

    Raises
    ------
    ScenarioError
        With one line for each mistake, those of the scenario included, or one line if a file cannot be read.
    """
    path = as_path(path, "a campaign file")
    return parse_campaign(read_text(path), str(path), path.resolve().parent)


def parse_campaign(text: str, source: str = "campaign", base_dir: str | Path | None = None) -> Campaign:
    """Return the campaign of a YAML text; `source` names it in errors, `base_dir` is where its scenario file is.

    Raises
    ------
    ScenarioError
        With one line for each mistake: line, column, name, what is wrong and what to do.
    """
    data, tree = read_tree(text, "campaign", A_CAMPAIGN, source)
    left_out = data.get("scenario") is None
    if not left_out:
        scenario = _scenario(data.pop("scenario"), tree, base_dir)
        data |= {} if scenario is None else {"scenario": scenario}
    campaign = None
    try:
        campaign = Campaign.model_validate(data)
    except ValidationError as error:
        for place, message, at_key in explained(error, data, Campaign):
            if place != ("scenario",) or left_out:  # it was there, and its mistakes are reported
                tree.report(place, message, at_key=at_key)
    if tree.mistakes or campaign is None:
        raise ScenarioError(source, tree.lines())
    return campaign


def _scenario(written: Any, tree: Tree, base_dir: str | Path | None) -> Scenario | None:
    """Return the scenario, from its file or from within; None if it has mistakes, which the tree then has too."""
    if isinstance(written, dict):
        return read_scenario(written, tree, ("scenario",), base_dir)
    if not isinstance(written, str):
        needs = "expected the path of a scenario file, or a scenario as a mapping"
        tree.report(("scenario",), f"{needs}; got {shown(written)}")
        return None
    path = Path(base_dir or ".") / written
    try:
        return load_scenario(path)
    except ScenarioError as error:
        for mistake in error.mistakes:
            tree.report(("scenario",), f"{path}: {mistake}")
    return None
