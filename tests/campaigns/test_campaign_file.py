"""Campaign files: what they become, and what is said about every kind of mistake, with line and column."""

# ruff: noqa: E501 - one pinned message per line

import itertools
from importlib import resources

import pytest

from passiflex.campaigns import Campaign, load_campaign, parse_campaign, require_possible
from passiflex.campaigns.distributions import Choice, LogUniform, Normal, Uniform
from passiflex.campaigns.ends import at_medians
from passiflex.campaigns.target import PathRefusedError, complete_data, locate
from passiflex.errors import ScenarioError
from passiflex.simulation import Scenario, load_scenario
from passiflex.texts.model_mistakes import fields, models

SCENARIOS = resources.files("passiflex") / "studies" / "scenarios"
FIG1 = load_scenario(str(SCENARIOS / "fig1_sampled.yaml"))

GOOD = """\
name: uncertain
scenario: fig1_sampled.yaml
samples: 1000
seed: 3
sampling: sobol
parameters:
  model_errors.joint_stiffness: {distribution: uniform, low: -50 %, high: 50 %}
  model_errors.motor_inertia: {distribution: normal, mean: 0, deviation: 20 %, low: -60 %}
  control.delay: {distribution: choice, values: [0 ms, 1 ms], weights: [1, 3]}
  control.inner_loop: {distribution: choice, values: [plain, matched]}
  noise.torque_variance: {distribution: log_uniform, low: 0.01, high: 1}
  posture.2: {distribution: uniform, low: 20 deg, high: 50 deg}
  motors.viscous_friction: {distribution: uniform, low: 0, high: 1, per: joint}
keep: {metrics: [margin, overshoot], worst: 5, by: margin, response: 50 ms}
"""

INLINE = """\
name: small
samples: 4
scenario:
  name: arm
  robot: robots/mine.yaml
  posture: [30 deg, 0.5]
  duration: 3 s
  law:
    type: impedance
    task: position
    shaped_stiffness: {ratio: 10}
    shaped_inertia: {ratio: 0.1}
    stiffness: {translation: 60 N/m}
    damping: {ratio: 0.7}
parameters:
  noise.torque_variance: {distribution: uniform, low: 0, high: 1}
"""


def mistakes(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as error:
        parse_campaign(text, base_dir=str(SCENARIOS))
    return error.value.mistakes


def changed(old: str, new: str, text: str = GOOD) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


def with_parameter(line: str) -> str:
    """Return a campaign with one parameter, which is in line 5."""
    return f"name: one\nscenario: fig1_sampled.yaml\nsamples: 10\nparameters:\n  {line}\n"


def test_a_complete_file():
    c = parse_campaign(GOOD, base_dir=str(SCENARIOS))
    assert (c.name, c.samples, c.seed, c.sampling) == ("uncertain", 1000, 3, "sobol")
    assert c.scenario == FIG1
    p = c.parameters
    assert p["model_errors.joint_stiffness"] == Uniform(low=-0.5, high=0.5)
    assert p["model_errors.motor_inertia"] == Normal(mean=0, deviation=0.2, low=-0.6)
    assert p["control.delay"] == Choice(values=(0, 0.001), weights=(1, 3))
    assert p["control.inner_loop"] == Choice(values=("plain", "matched"))
    assert p["noise.torque_variance"] == LogUniform(low=0.01, high=1)
    assert p["posture.2"].support == pytest.approx((0.3490658504, 0.872664626))
    assert p["motors.viscous_friction"] == Uniform(low=0, high=1, per="joint")
    assert (c.keep.metrics, c.keep.worst, c.keep.by) == (("margin", "overshoot"), 5, "margin")
    assert c.keep.response == 0.05
    require_possible(c)


def test_what_is_left_out():
    c = parse_campaign("name: bare\nscenario: fig1_sampled.yaml\nsamples: 1\n", base_dir=str(SCENARIOS))
    assert (c.seed, c.sampling, c.parameters, c.description) == (0, "random", {}, "")
    assert (c.keep.metrics, c.keep.worst, c.keep.by, c.keep.response) == (None, 0, None, None)


def test_a_campaign_made_in_memory_is_that_of_the_file():
    made = Campaign(
        name="one",
        scenario=FIG1,
        samples=10,
        parameters={"control.delay": {"distribution": "uniform", "low": "0 ms", "high": "1 ms"}},
    )
    text = with_parameter("control.delay: {distribution: uniform, low: 0 ms, high: 1 ms}")
    assert made == parse_campaign(text, base_dir=str(SCENARIOS))
    assert made == made.model_validate(dict(made))


@pytest.mark.parametrize("text", [GOOD, INLINE])
def test_the_text_of_a_campaign_stands_alone_and_loads_to_an_equal_one(text, tmp_path):
    c = parse_campaign(text, base_dir=str(SCENARIOS))
    again = parse_campaign(c.to_yaml(), base_dir=tmp_path)
    assert again == c
    assert list(again.parameters) == list(c.parameters)
    assert again.to_yaml() == c.to_yaml()


def test_files_are_found_beside_the_campaign(tmp_path):
    (tmp_path / "c.yaml").write_text(INLINE, encoding="utf-8")
    assert load_campaign(tmp_path / "c.yaml").scenario.robot == str(tmp_path / "robots" / "mine.yaml")
    (tmp_path / "s.yaml").write_text((SCENARIOS / "fig1_sampled.yaml").read_text(), encoding="utf-8")
    (tmp_path / "c.yaml").write_text(changed("fig1_sampled.yaml", "s.yaml"), encoding="utf-8")
    assert load_campaign(tmp_path / "c.yaml").scenario == FIG1


def test_a_section_that_the_scenario_leaves_out_is_made_if_it_is_then_valid():
    c = parse_campaign(INLINE)
    assert c.scenario.noise is None
    text = changed("noise.torque_variance", "noise.hold", INLINE)
    assert mistakes(changed("low: 0,", "low: 1 ms,", text)) == [
        "line 16, column 15, parameters.'noise.hold': with every parameter at its median: noise.torque_variance: missing: variance per joint, (N m)^2; or link_deviation, motor_deviation, of positions"
    ]


def test_parameters_may_make_a_section_together():
    text = INLINE + "  control.rate: {distribution: choice, values: [1 kHz, 2 kHz]}\n"
    text += "  control.jitter: {distribution: uniform, low: 0, high: 0.1 ms}\n"
    assert set(parse_campaign(text).parameters) == {"noise.torque_variance", "control.rate", "control.jitter"}


def test_what_an_arm_picks_up_is_uncertain_also_where_the_scenario_has_nothing():
    text = INLINE + "  payload.mass: {distribution: uniform, low: 0.5, high: 1.5}\n"
    text += "  payload.centre.3: {distribution: uniform, low: 2 cm, high: 10 cm}\n"
    c = parse_campaign(text)
    assert c.scenario.payload is None
    data = complete_data(c.scenario)
    payload = at_medians(c.parameters, {path: locate(data, path) for path in c.parameters}, data)["payload"]
    assert payload == {"mass": pytest.approx(1.0), "centre": [0.0, 0.0, pytest.approx(0.06)]}


def test_every_place_that_is_found_can_be_written():
    """Of each field of a scenario, of a section that is there or left out, whole or one number of it."""

    def places(model, before=()):
        for name, field in fields(model).items():
            yield (*before, name)
            for inner in models(field.annotation):
                yield from places(inner, (*before, name))

    full = complete_data(FIG1)
    bare = {name: full[name] for name in ("name", "robot", "posture", "law", "duration")}
    written = 0
    for place, tail, data in itertools.product(
        set(places(Scenario)), ((), ("1",), ("3",), ("1", "1")), (bare, full)
    ):
        try:
            target = locate(data, ".".join((*place, *tail)))
        except PathRefusedError:
            continue
        target.put(data, 1.0)
        written += 1
    assert written > 200


U01 = "{distribution: uniform, low: 0, high: 1}"


@pytest.mark.parametrize(
    ("parameter", "line"),
    [
        # paths
        (f"model_erors.motor_inertia: {U01}", "column 3, parameters.'model_erors.motor_inertia': unknown name 'model_erors'; try 'model_errors'"),
        (f"control.dleay: {U01}", "column 3, parameters.'control.dleay': unknown name 'dleay' in control; try 'delay'"),
        (f"law.stiffness.rotatoin: {U01}", "column 3, parameters.'law.stiffness.rotatoin': unknown name 'rotatoin' in law.stiffness; try 'rotation'"),
        (f"law.target_inertia.ratio: {U01}", "column 3, parameters.'law.target_inertia.ratio': unknown name 'target_inertia' in law; try 'shaped_inertia'"),
        (f"robot: {U01}", "column 3, parameters.robot: is not a number: name in the catalogue, or path of a robot file (.yaml)"),
        (f"seed: {U01}", "column 3, parameters.seed: every sample has its own seed, from that of the campaign; remove it"),
        (f"noise: {U01}", "column 3, parameters.noise: is a mapping; add the name of a number in it: torque_variance, link_deviation, motor_deviation, hold"),
        (f"forces: {U01}", "column 3, parameters.forces: is a list; add which entry, from 1, and the name of a number in it: forces.1.…"),
        (f"forces.1.force: {U01}", "column 3, parameters.'forces.1.force': is a list of numbers; add which one, from 1: forces.1.force.1"),
        (f"forces.2.force.1: {U01}", "column 3, parameters.'forces.2.force.1': forces has entries 1 to 1; got '2'"),
        (f"drags.1.dry: {U01}", "column 3, parameters.'drags.1.dry': drags is empty in the scenario; got '1'"),
        (f"posture.0: {U01}", "column 3, parameters.'posture.0': posture has entries 1 to 7; got '0'"),
        (f"posture.08: {U01}", "column 3, parameters.'posture.08': posture has entries 1 to 7; got '08'"),
        (f"posture.1.1: {U01}", "column 3, parameters.'posture.1.1': there is nothing in posture.1"),
        (f"duration.1: {U01}", "column 3, parameters.'duration.1': there is nothing in duration: it is one number"),
        (f"control.inner_loop.x: {U01}", "column 3, parameters.'control.inner_loop.x': there is nothing in control.inner_loop"),
        (f"actions.posture.1: {U01}", "column 3, parameters.'actions.posture.1': actions.posture is left out in the scenario; write a list there, or remove '1'"),
        # distributions
        ("control.delay: 3", "column 18, parameters.'control.delay': expected a mapping with per, low, high, distribution, mean, deviation, values, weights; got 3"),
        ("control.delay: {low: 0}", "column 18, parameters.'control.delay'.distribution: missing: one of 'uniform', 'log_uniform', 'normal', 'choice'"),
        ("control.delay: {distribution: lognormal}", "column 33, parameters.'control.delay'.distribution: unknown word 'lognormal'; try 'normal'"),
        ("control.delay: {distribution: uniform, low: 0}", "column 18, parameters.'control.delay'.high: missing: largest value"),
        ("control.delay: {distribution: uniform, low: 0, hihg: 1}", "column 50, parameters.'control.delay'.hihg: unknown name; try 'high'"),
        ("control.delay: {distribution: uniform, low: 2 ms, high: 1 ms}", "column 59, parameters.'control.delay'.high: needs more than low = 0.002; got 0.001"),
        ("control.delay: {distribution: uniform, low: 0 kg, high: 1 ms}", "column 47, parameters.'control.delay'.low: expected s, one number; got '0 kg' (kg)"),
        ("control.delay: {distribution: choice, values: 0}", "column 49, parameters.'control.delay'.values: expected a list; got 0"),
        ("control.delay: {distribution: choice, values: [0, 1 Hz]}", "column 53, parameters.'control.delay'.values[1]: expected s, one number; got '1 Hz' (Hz)"),
        ("control.inner_loop: {distribution: choice, values: [plain, mached]}", "column 62, parameters.'control.inner_loop'.values[1]: unknown word 'mached'; try 'matched'"),
        ("control.allow_unstable: {distribution: choice, values: [true, 3]}", "column 65, parameters.'control.allow_unstable'.values[1]: expected true or false; got 3"),
        (f"control.inner_loop: {U01}", "column 38, parameters.'control.inner_loop'.distribution: control.inner_loop is a word; take distribution: choice"),
        ("posture: {distribution: uniform, low: 0, high: 1}", "column 12, parameters.posture: is a list of numbers; add per: joint, or which one of them: posture.1"),
        ("control.delay: {distribution: uniform, low: 0, high: 0.001, per: joint}", "column 68, parameters.'control.delay'.per: control.delay has one value, not one per joint; remove it"),
        # impossible scenarios
        ("model_errors.joint_stiffness: {distribution: uniform, low: -150 %, high: 0}", "column 62, parameters.'model_errors.joint_stiffness'.low: expected one number, > -1; got -1.5 (too small)"),
        ("control.missed: {distribution: choice, values: [0, 95 %]}", "column 54, parameters.'control.missed'.values[1]: expected one number, ≥ 0, ≤ 0.9; got 0.95 (too large)"),
        ("model_errors.joint_stiffness: {distribution: normal, mean: 0, deviation: 20 %}", "column 33, parameters.'model_errors.joint_stiffness': has no end below, and the scenario takes numbers > -1 only; give `low: …`"),
        ("control.missed: {distribution: normal, mean: 0.1, deviation: 20 %, low: 0}", "column 19, parameters.'control.missed': has no end above, and the scenario takes numbers ≤ 0.9 only; give `high: …`"),
        ("control.delay: {distribution: uniform, low: 0, high: 30 ms}", "column 56, parameters.'control.delay'.high: no scenario with this value: control.delay: delay and jitter together are at most 20 periods with the matched inner loop; got 30 periods"),
        ("tank.floor: {distribution: uniform, low: 0, high: 2}", "column 15, parameters.'tank.floor': with every parameter at its median: tank.low: needs more than the floor of 1 J; got 0.2 J"),
    ],
)  # fmt: skip
def test_what_is_said_about_a_parameter(parameter, line):
    assert mistakes(with_parameter(parameter)) == [f"line 5, {line}"]


@pytest.mark.parametrize(
    ("old", "new", "lines"),
    [
        ("samples: 1000", "samples: 0", ["line 3, column 10, samples: expected a whole number, ≥ 1; got 0"]),
        ("samples: 1000", "samples: 1.5", ["line 3, column 10, samples: expected a whole number, ≥ 1; got 1.5"]),
        ("samples: 1000\n", "", ["line 1, column 1, samples: missing: number of simulations"]),
        ("samples: 1000", "sampels: 3", ["line 3, column 1, sampels: unknown name; try 'samples'"]),
        ("sampling: sobol", "sampling: sobbol", ["line 5, column 11, sampling: unknown word 'sobbol'; try 'sobol'"]),
        ("worst: 5", "worst: -1", ["line 14, column 45, keep.worst: expected a whole number, ≥ 0; got -1"]),
        ("by: margin, ", "", ["line 14, column 7, keep.by: missing: metric by which the samples kept in full are the worst"]),
        ("by: margin", "by: end_time", ["line 14, column 52, keep.by: 'end_time' is not kept; add it to metrics"]),
        ("by: margin", "by: energy", ["line 14, column 52, keep.by: unknown word 'energy'; try 'motor_energy'"]),
        ("response: 50 ms", "response: 50 m", ["line 14, column 70, keep.response: expected s, one number, > 0; got '50 m' (m)"]),
        ("fig1_sampled.yaml", "3", ["line 2, column 11, scenario: expected the path of a scenario file, or a scenario as a mapping; got 3"]),
        ("scenario: fig1_sampled.yaml\n", "", ["line 1, column 1, scenario: missing: path of the scenario file, from this file; or a scenario, as a mapping"]),
        (
            "  posture.2: {distribution: uniform, low: 20 deg, high: 50 deg}",
            "  posture.2: {distribution: uniform, low: 20 deg, high: 50 deg}\n  posture: {distribution: uniform, low: 20 deg, high: 50 deg, per: joint}",
            ["line 13, column 12, parameters.posture: overlaps with posture.2: both set the same entry of the scenario; remove one"],
        ),
    ],
)  # fmt: skip
def test_what_is_said_about_the_rest(old, new, lines):
    assert mistakes(changed(old, new)) == lines


def test_all_mistakes_at_once():
    text = (
        changed("low: -50 %", "low: -50 kg").replace("posture.2", "posture.9").replace("seed: 3", "seed: -3")
    )
    text = text.replace("low: 0.01", "low: 0").replace("low: -60 %", "low: -160 %")
    assert mistakes(text) == [
        "line 4, column 7, seed: expected a whole number, ≥ 0; got -3",
        "line 7, column 62, parameters.'model_errors.joint_stiffness'.low: expected one number; got '-50 kg' (kg)",
        "line 8, column 85, parameters.'model_errors.motor_inertia'.low: expected one number, > -1; got -1.6 (too small)",
        "line 11, column 59, parameters.'noise.torque_variance'.low: log_uniform needs numbers > 0; try uniform, or a small low; got 0",
        "line 12, column 3, parameters.'posture.9': posture has entries 1 to 7; got '9'",
    ]


def test_mistakes_of_the_scenario_are_there_too():
    text = changed("type: impedance", "type: impedanse", INLINE).replace("samples: 4", "samples: x")
    assert mistakes(text) == [
        "line 2, column 10, samples: expected a whole number, ≥ 1; got 'x'",
        "line 9, column 11, scenario.law.type: unknown word 'impedanse'; try 'impedance'",
    ]


def test_mistakes_of_a_scenario_file_name_it(tmp_path):
    (tmp_path / "s.yaml").write_text("name: x", encoding="utf-8")
    with pytest.raises(ScenarioError) as error:
        parse_campaign(changed("fig1_sampled.yaml", "s.yaml"), base_dir=tmp_path)
    path = tmp_path / "s.yaml"
    assert f"line 2, column 11, scenario: {path}: line 1, column 1, robot: missing: name in the" in str(
        error.value
    )
    with pytest.raises(ScenarioError, match=r"scenario: nowhere/s\.yaml: cannot be read: No such file"):
        parse_campaign(changed("fig1_sampled.yaml", "nowhere/s.yaml"))


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "empty; a campaign needs at least name, scenario and samples"), ("[", "no YAML")],
)
def test_a_text_that_is_no_mapping(text, message):
    assert message in mistakes(text)[0]


def test_a_parameter_that_is_no_mapping_of_paths():
    text = GOOD[: GOOD.index("parameters:")] + "parameters: [3]\n"
    assert mistakes(text) == ["line 6, column 13, parameters: expected a mapping; got [3]"]


def test_parameters_that_are_impossible_only_together_are_said_of_one_of_them():
    text = with_parameter("tank.floor: {distribution: uniform, low: 0.1, high: 0.19}")
    text += "  tank.low: {distribution: uniform, low: 0.11, high: 0.16}\n"
    (line,) = mistakes(text)
    assert "at its median: tank.low: needs more than the floor of 0.145 J; got 0.135 J" in line


def test_a_robot_that_cannot_be_there_is_refused_by_name():
    text = with_parameter("posture.2: {distribution: uniform, low: 30 deg, high: 150 deg}")
    c = parse_campaign(text, base_dir=str(SCENARIOS))
    with pytest.raises(ScenarioError) as error:
        require_possible(c)
    (line,) = error.value.mistakes
    assert line.startswith("parameters.'posture.2'.high: posture: joint 2 of 'iiwa14' is outside its limits")


def test_an_unbounded_parameter_is_asked_six_deviations_out():
    text = with_parameter("posture.2: {distribution: normal, mean: 100 deg, deviation: 5 deg}")
    with pytest.raises(ScenarioError) as error:
        require_possible(parse_campaign(text, base_dir=str(SCENARIOS)))
    (line,) = error.value.mistakes
    assert line.startswith("parameters.'posture.2': posture: joint 2")


def test_a_median_that_the_robot_cannot_have_is_refused_once():
    text = with_parameter("posture.2: {distribution: uniform, low: 150 deg, high: 160 deg}")
    with pytest.raises(ScenarioError, match="with every parameter at its median: posture: joint 2") as error:
        require_possible(parse_campaign(text, base_dir=str(SCENARIOS)))
    assert len(error.value.mistakes) == 1


def test_a_robot_that_cannot_be_loaded():
    with pytest.raises(ScenarioError, match="campaign 'small'"):
        require_possible(parse_campaign(INLINE))
