"""Whether the robot of a campaign can be in all that its parameters allow."""

from __future__ import annotations

from passiflex.campaigns.campaign import Campaign
from passiflex.campaigns.ends import at_medians, trials
from passiflex.errors import PassiflexError, ScenarioError
from passiflex.problems.resolution import resolve
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.scenarios.scenario import Scenario
from passiflex.texts.yaml_tree import dotted


def require_possible(campaign: Campaign) -> None:
    """Raise unless the robot can be in the scenario with every parameter at either end, others at their medians.

    A posture beyond the joint limits, a singular one, a list of the wrong length: what `resolve` finds. An unstable
    loop is not among it: `simulate` refuses that, unless `control.allow_unstable` is true.

    Raises
    ------
    ScenarioError
        With one line for each impossible end, the parameter named; or one line if the robot cannot be loaded.
    """
    source = f"campaign {campaign.name!r}"
    try:
        robot = FlexibleJointRobot.load(campaign.scenario.robot)
    except PassiflexError as error:
        raise ScenarioError(source, [str(error)]) from None
    middle = at_medians(campaign.parameters, campaign.targets, campaign.data)
    if (refused := _refused(middle, robot)) is not None:
        raise ScenarioError(source, [f"with every parameter at its median: {refused}"])
    mistakes = [
        f"{dotted(('parameters', path, *place))}: {refused}"
        for path, place, data in trials(campaign.parameters, campaign.targets, campaign.data)
        if (refused := _refused(data, robot)) is not None
    ]
    if mistakes:
        raise ScenarioError(source, mistakes)


def _refused(data: dict[str, object], robot: FlexibleJointRobot) -> str | None:
    try:
        resolve(Scenario.model_validate(data), robot)
    except PassiflexError as error:
        return str(error)
    return None
