"""Scenario files: what they become, and what is said about every kind of mistake, with line and column."""

# ruff: noqa: E501 - one pinned message per line

import math
from importlib import resources

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from passiflex.errors import ScenarioError
from passiflex.scenarios.law_settings import ImpedanceSettings, RigidSettings
from passiflex.scenarios.model_errors import Deviations, ModelErrors
from passiflex.scenarios.noise_settings import Noise
from passiflex.scenarios.reference import Circle, Hold, Move, Step
from passiflex.scenarios.scenario import Scenario, TankSettings
from passiflex.scenarios.scenario_file import load_scenario, parse_scenario
from passiflex.texts.text_file import MAX_BYTES

GOOD = """\
name: fig1
robot: iiwa14
posture: [0, 0.6, 0, -1.2, 0, 1.0, 0]
law:
  type: impedance
  task: pose
  shaped_stiffness: {ratio: 10}
  shaped_inertia: [0.1, 0.2 kg m^2]
  stiffness: {translation: 60 N/m, rotation: [1, 2, 3]}
  damping: {ratio: 0.7}
reference:
  - {at: 3 s, kind: move, by: [0, 0, 10 cm], duration: 2 s}
  - {at: 7 s, kind: circle, plane: [Y, z], radius: 0.1 m, period: 4 s}
  - {at: 10 s, kind: step, by: [0, 0, 0.1], turn: {value: [0, 0, 30], unit: deg}}
  - {at: 20 s, kind: hold}
forces:
  - {from: 20 s, to: 21 s, force: [0, 4, 0]}
model_errors: {joint_stiffness: 50 %}
noise: {torque_variance: 0.2 (N m)^2, hold: 1 ms}
duration: 30 s
tolerance: 1e-10
"""

RIGID = """\
name: baseline
robot: robots/mine.yaml
posture: [30 deg, 0]
law:
  type: rigid
  task: position
  target_inertia: {damping_ratio: 70 %}
  stiffness: {matrix: [[60, 1, 0], [1, 60, 0], [0, 0, 60]]}
  damping: {translation: 20 N s/m}
duration: 1 min
"""


def mistakes(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text)
    return error.value.mistakes


def changed(old: str, new: str, text: str = GOOD) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


def test_a_complete_file():
    s = parse_scenario(GOOD)
    assert isinstance(s.law, ImpedanceSettings)
    assert s.law.gravity == "static"
    assert s.law.regularisation is None  # settled with the robot
    assert s.law.shaped_inertia.value == (0.1, 0.2)
    np.testing.assert_array_equal(s.law.shaped_stiffness.resolve([1.0, 2.0]), [10.0, 20.0])
    np.testing.assert_array_equal(s.law.shaped_inertia.resolve([5.0, 5.0]), [0.1, 0.2])
    np.testing.assert_array_equal(s.law.stiffness.full(), np.diag([60, 60, 60, 1, 2, 3]))
    assert [type(e) for e in s.reference] == [Move, Circle, Step, Hold]
    assert s.reference[1].plane == ("y", "z")
    assert s.reference[2].turn == pytest.approx((0, 0, math.pi / 6))
    assert (s.forces[0].start, s.forces[0].end) == (20.0, 21.0)
    assert s.tank == TankSettings().completed("paper")
    assert s.tank.cap == math.inf
    assert s.noise == Noise(torque_variance=0.2, hold=0.001)
    assert (s.output_interval, s.tolerance, s.seed) == (0.005, 1e-10, 0)


def test_deviations_and_model_errors_are_for_all_joints_or_one_each():
    assert parse_scenario(GOOD).deviations == Deviations()
    written = "deviations: {joint_stiffness: [10 %, -0.2], link_inertia: 5 %}\nmodel_errors: {motor_inertia: [1, 2 %]}"
    s = parse_scenario(changed("model_errors: {joint_stiffness: 50 %}", written))
    assert s.deviations == Deviations(joint_stiffness=(0.1, -0.2), link_inertia=0.05)
    assert s.model_errors == ModelErrors(motor_inertia=(1.0, 0.02))
    assert parse_scenario(s.to_yaml()) == s


def test_the_rigid_law_has_no_tank_and_a_position_task_has_three_directions():
    s = parse_scenario(RIGID)
    assert isinstance(s.law, RigidSettings)
    assert (s.law.gravity, s.law.motor_inertia, s.tank) == ("model", "ignored", None)
    assert s.law.target_inertia.damping_ratio == 0.7
    assert s.law.stiffness.full().shape == s.law.damping.full().shape == (3, 3)


@pytest.mark.parametrize("text", [GOOD, RIGID, changed("duration: 30", "tank: {cap: 3 J}\nduration: 30")])
def test_the_resolved_scenario_loads_to_an_equal_one(text):
    s = parse_scenario(text)
    assert parse_scenario(s.to_yaml()) == s


@pytest.mark.parametrize("name", ["010", "1e3", "1.5", "null", "yes", "2024-01-01", "0x1f", "-", "09", "1_0"])
def test_names_that_look_like_something_else_survive(name):
    s = parse_scenario(changed("fig1", f"'{name}'") + f"description: 'a: {name} # é'\n")
    assert s.name == name
    assert parse_scenario(s.to_yaml()) == s


@pytest.mark.parametrize("name", ["fig1", "fig2", "fig3"])
def test_the_shipped_scenarios(name):
    s = load_scenario(str(resources.files("passiflex") / "studies" / "scenarios" / f"{name}.yaml"))
    assert (s.name, s.robot, s.duration, s.law.gravity, s.law.task) == (name, "iiwa14", 30.0, "robot", "pose")
    assert s.posture == (0.0, 0.6, 0.0, -1.2, 0.0, 1.0, 0.0)
    assert (s.law.shaped_stiffness.ratio, s.law.shaped_inertia.ratio) == (10.0, 0.01)
    assert s.law.null_space_damping == 5.0
    assert (s.tank.initial, s.tank.accounting) == (2.0, "paper")
    np.testing.assert_array_equal(s.law.stiffness.full(), 60 * np.eye(6))
    np.testing.assert_array_equal(s.law.damping.full(), 20 * np.eye(6))
    errors = tuple(s.model_errors.model_dump().values())
    assert errors == ((0.5, -0.5, -0.5, -0.5) if name == "fig3" else (0.0,) * 4)
    assert s.noise == (Noise(torque_variance=0.2, hold=0.001) if name == "fig3" else None)
    assert parse_scenario(s.to_yaml()) == s


def test_a_robot_file_is_found_beside_the_scenario(tmp_path):
    (tmp_path / "s.yaml").write_text(RIGID, encoding="utf-8")
    assert load_scenario(tmp_path / "s.yaml").robot == str(tmp_path / "robots" / "mine.yaml")
    (tmp_path / "s.yaml").write_text("\ufeff" + GOOD, encoding="utf-8")
    assert load_scenario(tmp_path / "s.yaml").robot == "iiwa14"
    assert parse_scenario(RIGID).robot == "robots/mine.yaml"


def test_an_empty_entry_counts_as_left_out():
    s = parse_scenario(
        changed("forces:\n  - {from: 20 s, to: 21 s, force: [0, 4, 0]}", "forces:\ntank:\ntool:")
    )
    assert (s.forces, s.tank, s.tool.position) == ((), TankSettings().completed("paper"), (0.0, 0.0, 0.0))


def test_anchors_are_allowed():
    text = changed("[0, 0, 10 cm]", "&up [0, 0, 10 cm]").replace("by: [0, 0, 0.1]", "by: *up")
    assert parse_scenario(text) == parse_scenario(GOOD)


ROT = "rotation: [1, 2, 3]"
K_X = "stiffness: {translation: 60 N/m, rotation: [1, 2, 3]}"
SHAPED = "shaped_stiffness: {ratio: 10}"


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        # names
        ("tolerance: 1e-10", "tolerence: 1", "line 21, column 1, tolerence: unknown name; try 'tolerance'"),
        (
            "  damping:",
            "  dmaping: 3\n  damping:",
            "line 10, column 3, law.dmaping: unknown name; try 'damping'",
        ),
        (
            "{ratio: 0.7}",
            "{ratio: 0.7, a b: 1}",
            "line 10, column 25, law.damping.'a b': unknown name; one of 'translation', 'rotation', 'matrix', 'axes', 'ratio'",
        ),
        ("duration: 30 s\n", "", "line 1, column 1, duration: missing: simulated time, s"),
        (
            ", duration: 2 s",
            "",
            "line 12, column 5, reference[0].duration: missing: how long the move takes, s",
        ),
        (
            "duration: 30 s",
            "duration: 30 s\nname: x",
            "line 21, column 1, name: twice in one mapping, first in line 1; remove one",
        ),
        ("duration: 30 s", "duration: 30 s\n? [a]\n: 3", "line 21, column 3: a name is not plain text"),
        # words
        (
            "type: impedance",
            "type: impedanse",
            "line 5, column 9, law.type: unknown word 'impedanse'; try 'impedance'",
        ),
        ("type: impedance", "type:", "line 5, column 3, law.type: missing: one of 'impedance', 'rigid'"),
        ("task: pose", "task: prose", "line 6, column 9, law.task: unknown word 'prose'; try 'pose'"),
        ("task: pose", "task: 3", "line 6, column 9, law.task: unknown word 3; one of 'pose', 'position'"),
        (
            "kind: hold",
            "kind: hodl",
            "line 15, column 22, reference[3].kind: unknown word 'hodl'; try 'hold'",
        ),
        (
            "[Y, z]",
            "[y, y]",
            "line 13, column 36, reference[1].plane: expected two different axes of x, y, z; got ['y', 'y']",
        ),
        # kinds
        ("fig1", "fig 1", "line 1, column 7, name: expected letters, digits, and any of _ . -; got 'fig 1'"),
        ("fig1", "12", "line 1, column 7, name: expected text; got 12; try quotes around it"),
        (
            "tolerance",
            "seed: 1.5\ntolerance",
            "line 21, column 7, seed: expected a whole number, ≥ 0; got 1.5",
        ),
        ("tolerance", "seed: -1\ntolerance", "line 21, column 7, seed: expected a whole number, ≥ 0; got -1"),
        (
            "noise: {torque_variance: 0.2 (N m)^2, hold: 1 ms}",
            "noise: 3",
            "line 19, column 8, noise: expected a mapping with torque_variance, link_deviation, motor_deviation, hold; got 3",
        ),
        (
            "forces:\n  -",
            "forces:",
            "line 16, column 9, forces: expected a list; got {'from': '20 s', 'to': '21 s', 'force': [0, 4, 0]}",
        ),
        (
            "fig1",
            "!!float 3",
            "line 1, column 7, name: the tag 'tag:yaml.org,2002:float' is not supported; remove it",
        ),
        ("fig1", '"\\ud800"', "line 1, column 7: a character that is not Unicode text"),
        # quantities
        (
            "60 N/m",
            "60 N s/m",
            "line 9, column 28, law.stiffness.translation: expected N/m, one number, 3 numbers or 3×3, ≥ 0; got '60 N s/m' (N s/m)",
        ),
        (
            "60 N/m",
            "-1 N/m",
            "line 9, column 28, law.stiffness.translation: expected N/m, one number, 3 numbers or 3×3, ≥ 0; got '-1 N/m' (too small)",
        ),
        (
            "60 N/m",
            "[[1, 2, 0], [2, 1, 0], [0, 0, 1]]",
            "line 9, column 28, law.stiffness.translation: the matrix is not positive definite; got smallest eigenvalue -1; needs > 0 in every direction",
        ),
        (
            "60 N/m",
            "[[1, 2, 0], [0, 1, 0], [0, 0, 1]]",
            "line 9, column 28, law.stiffness.translation: the matrix is not symmetric; got difference 2; needs a symmetric matrix",
        ),
        (
            "-1.2",
            ".nan",
            "line 3, column 10, posture: expected rad, a list of numbers; got [0, 0.6, 0, nan, 0, 1.0, 0] (not a number)",
        ),
        (
            "50 %",
            "-100 %",
            "line 18, column 33, model_errors.joint_stiffness: expected one number or a list of numbers, > -1; got '-100 %' (too small)",
        ),
        (
            "model_errors: {joint_stiffness: 50 %}",
            "deviations: {link_inertia: [10 %, -1]}",
            "line 18, column 28, deviations.link_inertia: expected one number or a list of numbers, > -1; got ['10 %', -1] (too small)",
        ),
        (
            "model_errors: {joint_stiffness: 50 %}",
            "deviations: {joint_damping: inf}",
            "line 18, column 29, deviations.joint_damping: expected one number or a list of numbers, > -1; got 'inf' (not finite)",
        ),
        (
            "model_errors: {joint_stiffness: 50 %}",
            "deviations: {link_mass: 3}",
            "line 18, column 14, deviations.link_mass: unknown name; try 'link_inertia'",
        ),
        (
            "1e-10",
            "1",
            "line 21, column 12, tolerance: expected one number, ≥ 1e-13, ≤ 0.001; got 1 (too large)",
        ),
        ("30 s", "inf", "line 20, column 11, duration: expected s, one number, > 0; got 'inf' (not finite)"),
        (
            SHAPED,
            "shaped_stiffness: a",
            "line 7, column 21, law.shaped_stiffness: expected N m/rad, one number or a list of numbers, > 0; got 'a' (not a number with a unit)",
        ),
        (
            SHAPED,
            "shaped_stiffness: {value: 1, unit: kg}",
            "line 7, column 29, law.shaped_stiffness.value: expected N m/rad, one number or a list of numbers, > 0; got {'value': 1, 'unit': 'kg'} (kg)",
        ),
        (
            SHAPED,
            "shaped_stiffness: {}",
            "line 7, column 21, law.shaped_stiffness: needs either a ratio or a quantity",
        ),
        # gains and task
        (
            ", " + ROT,
            "",
            "line 9, column 14, law.stiffness.rotation: missing; a pose task needs it, a position task does not",
        ),
        (
            ROT,
            "matrix: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
            "line 9, column 14, law.stiffness: needs exactly one of translation, matrix; got translation and matrix",
        ),
        (
            K_X,
            "stiffness: {}",
            "line 9, column 14, law.stiffness: needs exactly one of translation, matrix; got none of them",
        ),
        (
            K_X,
            "stiffness: {matrix: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}",
            "line 9, column 23, law.stiffness.matrix: a pose task needs 6×6 numbers in SI units; got 3×3",
        ),
        (
            "ratio: 0.7",
            "ratio: 0.7, " + ROT,
            "line 10, column 35, law.damping.rotation: goes with translation only; remove it",
        ),
        # tank
        (
            "tolerance",
            "tank: {initial: 0}\ntolerance",
            "line 21, column 17, tank.initial: a tank started empty never moves the reference; got 0 J; needs more than the floor of 0.01 J (the default)",
        ),
        (
            "tolerance",
            "tank: {low: 5 mJ}\ntolerance",
            "line 21, column 13, tank.low: needs more than the floor of 0.01 J (the default); got 0.005 J",
        ),
        (
            "tolerance",
            "tank: {cap: 0.1 J}\ntolerance",
            "line 21, column 13, tank.cap: needs at least the initial of 2 J (the default): what is above it is spilled; got 0.1 J",
        ),
        # time
        (
            "at: 7 s",
            "at: 3 s",
            "line 13, column 10, reference[1].at: needs to be later than the one before, 3 s; got 3 s",
        ),
        (
            "at: 20 s",
            "at: 30 s",
            "line 15, column 10, reference[3].at: needs to be earlier than the end, 30 s; got 30 s",
        ),
        (
            "to: 21 s",
            "to: 20 s",
            "line 17, column 22, forces[0].to: needs to be later than from = 20 s; got 20 s",
        ),
        (
            "from: 20 s, to: 21",
            "from: 30 s, to: 31",
            "line 17, column 12, forces[0].from: needs to be earlier than the end, 30 s; got 30 s",
        ),
        (
            "hold: 1 ms}\n",
            "hold: 3 ms}\noutput_interval: 5 ms\n",
            "line 20, column 18, output_interval: needs a whole multiple of noise.hold, 0.003 s; got 0.005 s",
        ),
        (
            "tolerance",
            "output_interval: 31 s\ntolerance",
            "line 21, column 18, output_interval: needs to be no longer than the duration, 30 s; got 31 s",
        ),
    ],
)
def test_each_mistake_is_one_line(old, new, line):
    assert mistakes(changed(old, new)) == [line]


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            "translation: 20 N s/m",
            "translation: 20, rotation: 1",
            "line 9, column 40, law.damping.rotation: a position task has no rotation; remove it, or take task: pose",
        ),
        (
            "duration",
            "tank: {}\nduration",
            "line 10, column 7, tank: only the impedance law has a tank; remove it, or take law type: impedance",
        ),
        (
            "type: rigid",
            "type: rigid\n  gravity: static",
            "line 6, column 12, law.gravity: unknown word 'static'; one of 'robot', 'model'",
        ),
        (
            "duration",
            "reference: [{at: 0, kind: step, by: [0, 0, 1], turn: [1, 0, 0]}]\nduration",
            "line 10, column 54, reference[0].turn: a position task has no orientation; remove it",
        ),
        (
            "60]]",
            "1e-3], [0, 0, 0]]",
            "line 8, column 23, law.stiffness.matrix: expected SI units, 3×3 or 6×6; got [[60, 1, 0], [1, 60, 0], [0, 0, '1e-3'], [0, 0, 0]] (4×3)",
        ),
    ],
)
def test_mistakes_in_a_rigid_scenario(old, new, line):
    assert mistakes(changed(old, new, RIGID)) == [line]


def test_all_mistakes_at_once_in_the_order_of_the_file():
    text = GOOD
    for old, new in [
        ("name: fig1", "name: fig 1"),
        ("1.0, 0]", "x]"),
        ("task: pose", "task: posse"),
        (K_X, K_X.replace("60 N/m", "60 N")),
        ("[0, 0, 10 cm]", "[0, 10 cm]"),
        ("radius", "raduis"),
        ("0.2 (N m)^2", "0.2 N m"),
        ("duration: 30 s", "duration: 30 s\nduration: 40 s"),
    ]:
        text = changed(old, new, text)
    assert [m.split(": ")[0] for m in mistakes(text)] == [
        "line 1, column 7, name",
        "line 3, column 10, posture",
        "line 6, column 9, law.task",
        "line 9, column 28, law.stiffness.translation",
        "line 12, column 31, reference[0].by",
        "line 13, column 44, reference[1].raduis",
        "line 19, column 26, noise.torque_variance",
        "line 21, column 1, duration",
    ]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "empty; a scenario needs at least name, robot, posture, law and duration"),
        ("# only a comment", "empty; a scenario needs at least name, robot, posture, law and duration"),
        ("- a", "line 1, column 1: not a mapping; try 'name: ...'"),
        ("hello", "line 1, column 1: not a mapping; try 'name: ...'"),
        (
            "\n<?xml version='1.0'?>\n<robot/>",
            "XML in place of YAML, as of a URDF, which a robot file names in its entry urdf; a scenario needs at least name, robot, posture, law and duration",
        ),
        ("a: b: c", "line 1, column 5: no YAML: mapping values are not allowed here"),
        (
            "\n  a: [1\n",
            "line 3, column 1: no YAML: while parsing a flow sequence, expected ',' or ']', but got '<stream end>'",
        ),
        ("a: *b", "line 1, column 4: no YAML: found undefined alias 'b'"),
        ("a: 1\n\0", "line 2, column 1: a character that YAML does not allow"),
        ('a: "\\UFFFFFFFF"', "no YAML: Python int too large to convert to C int"),
        ("[" * 5000, "nested too deeply"),
        ("a: " + "[" * 40 + "]" * 40, "line 1, column 34: nested too deeply"),
        ("a: &b [*b]", "line 1, column 4: nested too deeply"),
        (
            "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
            + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9)),
            "more than 100000 entries, aliases counted as often as they are used",
        ),
    ],
)
def test_what_is_no_tree_of_values_is_one_mistake(text, line):
    assert mistakes(text) == [line]


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "latin.yaml").write_bytes("name: é".encode("latin-1"))
    (tmp_path / "large.yaml").write_bytes(b" " * (MAX_BYTES + 1))
    for name, line in [
        ("none.yaml", "cannot be read: No such file or directory"),
        ("\0", "cannot be read: embedded null byte"),
        ("a" * 5000, "cannot be read: File name too long"),
        ("", "cannot be read: Is a directory"),
        ("latin.yaml", "cannot be read: not UTF-8 text"),
        ("large.yaml", "cannot be read: larger than 1 MB"),
    ]:
        with pytest.raises(ScenarioError) as error:
            load_scenario(tmp_path / name)
        assert error.value.mistakes == [line]
        assert str(error.value).startswith(str(tmp_path / name))


@pytest.mark.parametrize("path", [None, "", " ", b"scenario.yaml", 3, {}])
def test_what_is_no_path_is_an_error_of_the_package(path):
    with pytest.raises(
        ScenarioError, match="no scenario; try the path of its file, or parse_scenario for a text"
    ):
        load_scenario(path)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be"])
def test_a_file_is_read_in_the_encoding_that_it_says(tmp_path, encoding):
    (tmp_path / "s.yaml").write_text(GOOD + "description: größer\n", encoding=encoding)
    assert load_scenario(tmp_path / "s.yaml").description == "größer"


YAMLISH = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(
                sorted(
                    {
                        *Scenario.model_fields,
                        *ImpedanceSettings.model_fields,
                        "at",
                        "kind",
                        "by",
                        "value",
                        "unit",
                        "matrix",
                    }
                )
            ),
            inner,
            max_size=6,
        )
    ),
    max_leaves=20,
)


@given(st.text() | st.text(alphabet="{}[]:,&*!|>'\"%@`-? \n\tab1~#\\"))
def test_any_text_is_a_scenario_or_a_scenario_error(text):
    with pytest.raises(ScenarioError):
        parse_scenario(text)


@given(
    st.sampled_from(["law", "tank", "reference", "forces", "noise", "tool", "posture", "robot", "seed"]),
    YAMLISH,
)
def test_any_values_are_a_scenario_or_a_scenario_error(name, value):
    data = yaml.safe_load(GOOD) | {name: value}
    try:
        found = [parse_scenario(yaml.safe_dump(data)).name]
    except ScenarioError as error:
        found = error.mistakes
    assert found
    assert all("\n" not in line for line in found)


def test_a_scenario_can_be_made_in_python():
    s = parse_scenario(GOOD)
    assert Scenario(**{n: getattr(s, n) for n in Scenario.model_fields}) == s
