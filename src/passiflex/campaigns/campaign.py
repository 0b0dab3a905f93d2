"""What a campaign is: a scenario, what of it is uncertain, how often and how it is sampled, what is kept."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Literal, Self

import yaml
from pydantic import Field, ValidationInfo, ValidatorFunctionWrapHandler, field_validator, model_validator

from passiflex.campaigns.distributions import Distribution
from passiflex.campaigns.parameters import checked
from passiflex.campaigns.target import Target, complete_data, joints_of, locate
from passiflex.metrics.measures import MEASURES
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.spans import Seconds
from passiflex.texts.model_mistakes import word
from passiflex.texts.section import Mistakes, Section

MOST_SAMPLES = 1_000_000


class Keep(Section):
    """What is kept of the samples beside their draws."""

    metrics: tuple[str, ...] | None = Field(
        default=None, min_length=1, description="list of the metrics that are kept; all if left out"
    )
    worst: int = Field(
        default=0, ge=0, strict=True, description="number of the worst samples kept as full runs"
    )
    by: str | None = Field(default=None, description="metric by which they are the worst")
    response: Seconds | None = Field(
        default=None,
        description="interval at which the displacement of the end effector is kept, s; not kept if left out",
    )

    @field_validator("metrics")
    @classmethod
    def _known_metrics(cls, metrics: tuple[str, ...] | None) -> tuple[str, ...] | None:
        found = [
            ((i,), word(name, list(MEASURES))) for i, name in enumerate(metrics or ()) if name not in MEASURES
        ]
        if found:
            raise Mistakes(*found)
        return metrics

    @field_validator("by")
    @classmethod
    def _known_metric(cls, by: str | None) -> str | None:
        if by is not None and by not in MEASURES:
            raise ValueError(word(by, list(MEASURES)))
        return by

    @model_validator(mode="after")
    def _by_a_metric(self) -> Self:
        if self.worst and self.by is None:
            raise Mistakes((("by",), "missing: metric by which the samples kept in full are the worst"))
        if self.by is not None and self.metrics is not None and self.by not in self.metrics:
            raise Mistakes((("by",), f"{self.by!r} is not kept; add it to metrics"))
        return self


class Campaign(Section):
    """Many simulations of one scenario with uncertain parameters; the same text gives the same samples again.

    Two parameters never set the same entry, and the scenario is valid with every parameter at either end of its
    support while the others are at their medians. `possible.require_possible` asks the robot, too.
    """

    name: str = Field(
        pattern=r"^[A-Za-z0-9_.-]+$",
        max_length=80,
        description="name of the campaign: letters, digits, and any of _ . -",
    )
    description: str = Field(default="", description="what it is to show")
    scenario: Scenario = Field(
        description="path of the scenario file, from this file; or a scenario, as a mapping"
    )
    samples: int = Field(ge=1, le=MOST_SAMPLES, strict=True, description="number of simulations")
    seed: int = Field(default=0, ge=0, strict=True, description="seed of all that is random")
    sampling: Literal["random", "latin_hypercube", "sobol"] = Field(
        default="random",
        description="random: independent draws; latin_hypercube: one draw in each of `samples` equal parts of "
        "every parameter; sobol: scrambled, evenly spread, best with a power of two of samples",
    )
    parameters: dict[str, Distribution] = Field(
        default={}, description="distribution of each uncertain entry of the scenario, by its dotted path"
    )
    keep: Keep = Field(default=Keep(), description="what is kept of the samples beside their draws")

    @field_validator("parameters", mode="wrap")
    @classmethod
    def _of_the_scenario(
        cls, written: Any, validate: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> Any:
        if "scenario" not in info.data:  # its mistakes come first: without it no path leads anywhere
            return {}
        return checked(written, complete_data(info.data["scenario"]), validate)

    @cached_property
    def data(self) -> dict[str, Any]:
        """Return the complete data of the scenario, into which values are put; not to be changed."""
        return complete_data(self.scenario)

    @cached_property
    def targets(self) -> dict[str, Target]:
        """Return where each parameter leads in the scenario."""
        return {path: locate(self.data, path) for path in self.parameters}

    @property
    def joints(self) -> int:
        """Return the number of joints."""
        return joints_of(self.scenario.posture, self.scenario.robot)

    def to_yaml(self) -> str:
        """Return the text of a file that loads to an equal campaign: the scenario within, in SI units."""
        data = self.model_dump(by_alias=True, exclude_none=True)
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)
