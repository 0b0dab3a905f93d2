"""Who is blamed for what a law's books miss: what is in the problem, and nothing that is not."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from passiflex.passivity import audit
from passiflex.problems.unbooked import NOTHING, UNKNOWN, listed, unbooked
from passiflex.simulation import Run, parse_scenario, resolve, simulate
from worlds import PERIOD, planar_text, world

NOISE: dict[str, Any] = {"noise": {"torque_variance": 0.04, "hold": PERIOD}}
WRONG: dict[str, Any] = {"model_errors": {"link_inertia": 0.2}}
WORN: dict[str, Any] = {"motors": {"coulomb_friction": 1}}
OSC = """\
name: osc
robot: iiwa14
posture: [0, 35 deg, 0, -70 deg, 0, 55 deg, 0]
law:
  type: rigid
  task: pose
  gravity: robot
  stiffness: {translation: 150, rotation: 150}
  damping: {translation: 24.5, rotation: 24.5}
  target_inertia: {translation: 1, rotation: 1}
  null_space_damping: 10
  motor_inertia: carried
control: {rate: 1 kHz, delay: 0 s, inner_loop: plain, external_torque: none}
reference:
  - {at: 0.1 s, kind: step, by: [5 cm, 0, 0]}
duration: 0.4
output_interval: 0.05
"""
"""1 kg instead of the 4 kg that are there, and nobody measures the force."""


def continuous(**changes: Any) -> str:
    return unbooked(resolve(parse_scenario(planar_text(**changes))))


def sampled(**changes: Any) -> str:
    return unbooked(resolve(world(**changes)))


def test_only_what_is_there_is_named() -> None:
    assert continuous() == NOTHING
    assert continuous(**NOISE) == "noise"
    assert continuous(noise={"torque_variance": 0, "hold": PERIOD}) == NOTHING
    assert continuous(**WRONG) == "model error"
    assert continuous(deviations={"joint_stiffness": -0.1}) == "model error"
    assert continuous(**NOISE, **WRONG) == "model error and noise" == UNKNOWN
    assert continuous(model_errors={"link_inertia": 0.2}, deviations={"link_inertia": 0.2}) == NOTHING


def test_a_sampled_law_does_not_know_what_passes_between_two_samples() -> None:
    assert sampled() == "sampling"
    assert sampled(**WRONG, **NOISE, **WORN) == "sampling, model error, noise and friction of the motors"


@pytest.mark.parametrize(
    ("torque", "words"),
    [
        ("none", "inertia shaped by the law without force sensing"),
        ("true", "inertia shaped by the law"),
        (None, "inertia shaped by the law"),
    ],
)
def test_the_rigid_law_shapes_the_inertia(torque: str | None, words: str) -> None:
    """It measures no joint torque: noise of that is none of it."""
    data = yaml.safe_load(OSC) | NOISE
    if torque is None:
        del data["control"]
    else:
        data["control"]["external_torque"] = torque
    assert unbooked(resolve(parse_scenario(yaml.safe_dump(data)))) == words


def test_a_light_hand_without_force_sensing_is_violated_and_says_why() -> None:
    """Shaped from 4 kg to 1 kg, it gives the links more than ½ K (5 cm)² that the step stored: W̃ is their motion."""
    run = simulate(parse_scenario(OSC))
    result = audit(run)
    assert result.verdict == "violated"
    assert result.term == "inertia shaped by the law without force sensing"
    assert result.remedy == "take a larger target_inertia, lower the gains or take the impedance law"
    heavy = OSC.replace("{translation: 1, rotation: 1}", "{translation: 8, rotation: 1}")
    assert audit(simulate(parse_scenario(heavy))).verdict == "passive"
    given = run["link_kinetic_energy"].max()
    assert -result.margin >= given - 150 * 0.05**2 / 2 > 0.1


def test_an_older_file_does_not_say() -> None:
    data = simulate(parse_scenario(planar_text(duration=0.1, reference=None))).data
    assert data.attrs["unbooked"] == NOTHING
    assert Run(data.drop_attrs(deep=False).assign_attrs(name="x")).unbooked == UNKNOWN


def test_words_are_listed_as_people_list_them() -> None:
    assert listed([]) == ""
    assert listed(["a"]) == "a"
    assert listed(["a", "b"]) == "a and b"
    assert listed(["a", "b", "c"], "or") == "a, b or c"
