"""The settings of sampled runs: what they become, and what is said about every kind of mistake, line and column."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from passiflex.errors import PassiflexError, ScenarioError, SizeError
from passiflex.scenarios.control_settings import Fallback
from passiflex.scenarios.sensor_settings import SensorSettings
from passiflex.scenarios.tank_settings import TankSettings
from passiflex.simulation import Scenario, parse_scenario, resolve
from passiflex.studies import shipped_scenario

GOOD = """\
name: sampled
robot: planar2r
posture: [0.5, 0.8]
law:
  type: impedance
  task: position
  gravity: robot
  shaped_stiffness: {ratio: 1}
  shaped_inertia: {ratio: 0.5}
  stiffness: {translation: 200}
  damping: {translation: 40}
control: {rate: 2 kHz, delay: 0.75 ms}
sensors: {link_resolution: 0.01 deg}
motors: {torque_limit: robot}
tank: {kind: port}
actions: {follow_velocity: 50 %}
gains:
  - {at: 0.1, duration: 200 ms, stiffness: {translation: 3 N/cm}}
  - {at: 0.3 s, duration: 0.1, damping: {translation: 30}}
feedforward: [{from: 0.1, to: 0.2, force: [1, 0, 0]}]
drags: [{from: 100 ms, to: 0.2, viscous: 3 N s/m, dry: 2}]
noise: {torque_variance: 0.2, hold: 0.5 ms}
duration: 0.6
"""
RIGID = """\
name: rigid
robot: planar2r
posture: [0.5, 0.8]
law:
  type: rigid
  task: position
  target_inertia: {damping_ratio: 0.7}
  stiffness: {translation: 200}
  damping: {translation: 40}
control: {rate: 1000}
duration: 1
"""
CONTROL = "control: {rate: 2 kHz, delay: 0.75 ms}"
EYE = "[[1,0,0,0,0,0],[0,1,0,0,0,0],[0,0,1,0,0,0],[0,0,0,1,0,0],[0,0,0,0,1,0],[0,0,0,0,0,1]]"


def changed(old: str, new: str, text: str = GOOD) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


def mistakes(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text)
    return error.value.mistakes


def test_a_complete_file_is_in_si_units() -> None:
    s = parse_scenario(GOOD)
    assert s.control is not None
    assert s.sensors is not None
    assert s.motors is not None
    assert s.actions is not None
    assert (s.control.rate, s.control.delay) == (2000.0, pytest.approx(0.75e-3))
    assert (s.control.inner_loop, s.control.external_torque, s.control.allow_unstable) == (
        "plain",
        "measured",
        False,
    )
    assert s.sensors.link_resolution == pytest.approx(math.radians(0.01))
    assert (s.sensors.velocity, s.sensors.torque_bandwidth) == ("true", math.inf)
    assert (s.motors.torque_limit, s.motors.torque_rate_limit) == ("robot", math.inf)
    assert s.actions.follow_velocity == 0.5
    first, second = s.gain_changes
    assert (first.at, first.duration, first.damping) == (0.1, 0.2, None)
    np.testing.assert_allclose(first.stiffness.full(), 300 * np.eye(3))
    assert second.stiffness is None
    (drag,) = s.environment
    assert (drag.start, drag.end, drag.viscous, drag.dry) == (0.1, 0.2, 3, 2)
    assert s.feedforward[0].moment == (0, 0, 0)


@pytest.mark.parametrize(
    ("old", "new", "where", "value"),
    [
        ("2 kHz", "{value: 2, unit: kHz}", "control.rate", 2000.0),
        ("0.75 ms", "750 us", "control.delay", 0.75e-3),
        ("0.75 ms", "0.75 ms, missed: 5 %", "control.missed", 0.05),
        ("0.75 ms", "0.75 ms, observer_bandwidth: 0.1 kHz", "control.observer_bandwidth", 100.0),
        ("0.01 deg", "0, velocity_filter: 200 Hz", "sensors.velocity_filter", 200.0),
        ("0.01 deg", "0, torque_bandwidth: inf", "sensors.torque_bandwidth", math.inf),
        ("0.01 deg", "0, motor_resolution: 1 mrad", "sensors.motor_resolution", 1e-3),
        ("torque_limit: robot", "torque_rate_limit: 2 kN m/s", "motors.torque_rate_limit", 2000.0),
        ("torque_limit: robot", "coulomb_friction: [1, 2 N m]", "motors.coulomb_friction", (1.0, 2.0)),
        ("torque_limit: robot", "friction_width: 1 deg/s", "motors.friction_width", math.radians(1)),
        ("follow_velocity: 50 %", "posture: [30 deg, 0]", "actions.posture", (math.radians(30), 0.0)),
        ("kind: port", "kind: port, power: 0.1 kW", "tank.power", 100.0),
        ("kind: port", "kind: port, trip: 50 mJ", "tank.trip", 0.05),
        ("kind: port", "kind: port, floor: 150 mJ", "tank.low", 0.2),
    ],
)  # fmt: skip
def test_units_are_converted(old: str, new: str, where: str, value: Any) -> None:
    section, name = where.split(".")
    got = getattr(getattr(parse_scenario(changed(old, new)), section), name)
    assert got == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("name", ["fig1_sampled", "fig2_sampled"])
def test_the_shipped_scenarios(name: str) -> None:
    s = shipped_scenario(name)
    assert s.control is not None
    assert s.tank is not None
    assert (s.control.rate, s.control.delay, s.control.inner_loop) == (1000, 1e-3, "matched")
    assert (s.tank.kind, s.tank.accounting, s.tank.floor, s.tank.low) == ("port", "signed", 0.1, 0.2)
    assert parse_scenario(s.to_yaml()) == s


def test_what_is_left_out() -> None:
    """The tank of a sampled run is the port's, with its own levels, whatever of them is left out."""
    s = parse_scenario(changed("tank: {kind: port}\n", ""))
    assert s.tank == TankSettings().completed("port")
    assert (s.tank.kind, s.tank.accounting, s.tank.floor, s.tank.low) == ("port", "signed", 0.1, 0.2)
    paper = parse_scenario(changed("kind: port", "kind: paper")).tank
    assert paper is not None
    assert (paper.accounting, paper.floor, paper.low) == ("paper", 0.01, 0.05)
    s = parse_scenario(changed("sensors: {link_resolution: 0.01 deg}", "sensors:"))
    assert s.sensors in (None, SensorSettings())
    assert s.control is not None
    assert s.control.fallback == Fallback()


@pytest.mark.parametrize(
    "text", [GOOD, RIGID, changed("kind: port", "kind: time_domain, braking: 3, floor: 20 mJ")]
)
def test_the_resolved_scenario_loads_to_an_equal_one(text: str) -> None:
    s = parse_scenario(text)
    assert parse_scenario(s.to_yaml()) == s
    assert Scenario(**{name: getattr(s, name) for name in Scenario.model_fields}) == s


PERIODS = "delay and jitter together are at most 60 periods"
PREDICTED = "delay and jitter together are at most 20 periods with the matched inner loop"
ONLY = "needs `control`: only a sampled run has it"


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        # control
        ("2 kHz", "0", "line 12, column 17, control.rate: expected Hz, one number, > 0, ≤ 1e+06; got 0 (too small)"),
        ("2 kHz", "-1 Hz", "line 12, column 17, control.rate: expected Hz, one number, > 0, ≤ 1e+06; got '-1 Hz' (too small)"),
        ("2 kHz", "2 MHz", "line 12, column 17, control.rate: expected Hz, one number, > 0, ≤ 1e+06; got '2 MHz' (too large)"),
        ("2 kHz", "2 ms", "line 12, column 17, control.rate: expected Hz, one number, > 0, ≤ 1e+06; got '2 ms' (ms)"),
        ("rate: 2 kHz, ", "", "line 12, column 10, control.rate: missing: control rate, Hz"),
        ("0.75 ms", "-1 ms", "line 12, column 31, control.delay: expected s, one number, ≥ 0; got '-1 ms' (too small)"),
        ("0.75 ms", "31 ms", f"line 12, column 31, control.delay: {PERIODS}; got 62 periods"),
        ("delay: 0.75 ms", "jitter: 31 ms", f"line 12, column 32, control.jitter: {PERIODS}; got 62 periods"),
        ("0.75 ms", "29 ms, jitter: 2 ms", f"line 12, column 31, control.delay: {PERIODS}; got 62 periods"),
        ("0.75 ms", "9 ms, jitter: 2 ms, inner_loop: matched", f"line 12, column 31, control.delay: {PREDICTED}; got 22 periods"),
        ("0.75 ms", "0, jitter: -1", "line 12, column 42, control.jitter: expected s, one number, ≥ 0; got -1 (too small)"),
        ("0.75 ms", "0, missed: 95 %", "line 12, column 42, control.missed: expected one number, ≥ 0, ≤ 0.9; got '95 %' (too large)"),
        ("0.75 ms", "0, inner_loop: mached", "line 12, column 46, control.inner_loop: unknown word 'mached'; try 'matched'"),
        ("0.75 ms", "0, external_torque: guessed", "line 12, column 51, control.external_torque: unknown word 'guessed'; try 'measured'"),
        ("0.75 ms", "0, observer_bandwidth: 0", "line 12, column 54, control.observer_bandwidth: expected Hz, one number, > 0; got 0 (too small)"),
        ("0.75 ms", "0, allow_unstable: 1", "line 12, column 50, control.allow_unstable: expected true or false; got 1"),
        ("0.75 ms", "0, allow_unstable: maybe", "line 12, column 50, control.allow_unstable: expected true or false; got 'maybe'"),
        ("0.75 ms", "0, fallback: {stiffness: {translation: 5, rotation: 3}}", "line 12, column 83, control.fallback.stiffness.rotation: a position task has no rotation; remove it, or take task: pose"),
        ("0.75 ms", f"0, fallback: {{stiffness: {{matrix: {EYE}}}}}", "line 12, column 65, control.fallback.stiffness.matrix: a position task needs 3×3 numbers in SI units; got 6×6"),
        ("0.75 ms", "0, fallback: {damping: {ratio: 0.7}}", "line 12, column 54, control.fallback.damping: a damping ratio belongs to one posture; give D_x itself"),
        ("0.75 ms", "0, fallback: {shaped_inertia: {}}", "line 12, column 61, control.fallback.shaped_inertia: needs either a ratio or a quantity"),
        # sensors and motors
        ("0.01 deg", "-1 deg", "line 13, column 28, sensors.link_resolution: expected rad, one number, ≥ 0; got '-1 deg' (too small)"),
        ("0.01 deg", "0, velocity: diff", "line 13, column 41, sensors.velocity: unknown word 'diff'; try 'differences'"),
        ("link_resolution: 0.01 deg", "velocity_filter: 0", "line 13, column 28, sensors.velocity_filter: expected Hz, one number, > 0; got 0 (too small)"),
        ("link_resolution: 0.01 deg", "torque_bandwith: 3", "line 13, column 11, sensors.torque_bandwith: unknown name; try 'torque_bandwidth'"),
        ("link_resolution: 0.01 deg", "torque_scale: 60 %", "line 13, column 25, sensors.torque_scale: expected one number or a list of numbers, ≥ -0.5, ≤ 0.5; got '60 %' (too large)"),
        ("link_resolution: 0.01 deg", "torque_offset: 3 N", "line 13, column 26, sensors.torque_offset: expected N m, one number or a list of numbers; got '3 N' (N)"),
        ("link_resolution: 0.01 deg", "link_offset: inf", "line 13, column 24, sensors.link_offset: expected rad, one number or a list of numbers; got 'inf' (not finite)"),
        ("torque_limit: robot", "torque_limit: robots", "line 14, column 24, motors.torque_limit: expected none or robot or N m, one number or a list of numbers, > 0; got 'robots' (not a number with a unit)"),
        ("torque_limit: robot", "torque_rate_limit: 0", "line 14, column 29, motors.torque_rate_limit: expected N m/s, one number or a list of numbers, > 0; got 0 (too small)"),
        ("torque_limit: robot", "coulomb_friction: [1, -1]", "line 14, column 28, motors.coulomb_friction: expected N m, one number or a list of numbers, ≥ 0; got [1, -1] (too small)"),
        # tank
        ("kind: port", "kind: prt", "line 15, column 14, tank.kind: unknown word 'prt'; try 'port'"),
        ("kind: port", "kind: port, trip: 0.1", "line 15, column 26, tank.trip: needs less than the floor of 0.1 J (the default); got 0.1 J"),
        ("kind: port", "trip: 0.3, floor: 0.15", "line 15, column 14, tank.trip: needs less than the floor of 0.15 J; got 0.3 J"),
        ("kind: port", "initial: 0.1", "line 15, column 17, tank.initial: a tank started empty never moves the reference; got 0.1 J; needs more than the floor of 0.1 J"),
        ("kind: port", "low: 90 mJ", "line 15, column 13, tank.low: needs more than the floor of 0.1 J; got 0.09 J"),
        ("kind: port", "kind: paper, trip: 20 mJ", "line 15, column 27, tank.trip: needs less than the floor of 0.01 J (the default); got 0.02 J"),
        # actions, gains, what happens when
        ("50 %", "150 %", "line 16, column 28, actions.follow_velocity: expected one number, ≥ 0, ≤ 1; got '150 %' (too large)"),
        ("follow_velocity: 50 %", "posture_stiffness: -2", "line 16, column 30, actions.posture_stiffness: expected N m/rad, one number or a list of numbers, ≥ 0; got -2 (too small)"),
        ("at: 0.3 s", "at: 0.25 s", "line 19, column 10, gains[1].at: the change before lasts longer; got 0.25 s"),
        ("{translation: 30}", "{ratio: 0.7}", "line 19, column 41, gains[1].damping: a damping ratio belongs to one posture; give D_x itself"),
        ("{translation: 30}", "{translation: 30, rotation: 3}", "line 19, column 69, gains[1].damping.rotation: a position task has no rotation; remove it, or take task: pose"),
        ("at: 0.3 s", "at: 0.6", "line 19, column 10, gains[1].at: needs to be earlier than the end, 0.6 s; got 0.6 s"),
        ("200 ms", "-1", "line 18, column 25, gains[0].duration: expected s, one number, ≥ 0; got -1 (too small)"),
        ("at: 0.1, duration: 200 ms", "at: 0.3, duration: 0", "line 19, column 10, gains[1].at: needs to be later than the one before, 0.3 s; got 0.3 s"),
        ("[{from: 0.1, to: 0.2, force: [1, 0, 0]}]", "[{from: 0.2, to: 0.2}]", "line 20, column 31, feedforward[0].to: needs to be later than from = 0.2 s; got 0.2 s"),
        ("[1, 0, 0]", "[1, 0]", "line 20, column 43, feedforward[0].force: expected N, 3 numbers; got [1, 0] (2 numbers)"),
        ("from: 100 ms", "from: 0.3", "line 21, column 25, drags[0].to: needs to be later than from = 0.3 s; got 0.2 s"),
        ("from: 100 ms, to: 0.2", "from: 600 ms, to: 2", "line 21, column 16, drags[0].from: needs to be earlier than the end, 0.6 s; got 0.6 s"),
        ("3 N s/m", "-3", "line 21, column 42, drags[0].viscous: expected N s/m, one number, ≥ 0; got -3 (too small)"),
        ("0.5 ms", "0.8 ms", "line 22, column 37, noise.hold: needs a whole multiple of the control period, 0.0005 s: sensors are read once in it; got 0.0008 s"),
        ("0.5 ms", "0.1 ms", "line 22, column 37, noise.hold: needs a whole multiple of the control period, 0.0005 s: sensors are read once in it; got 0.0001 s"),
        ("control: {rate: 2 kHz, delay: 0.75 ms}", "control: {rate: 0}", "line 12, column 17, control.rate: expected Hz, one number, > 0, ≤ 1e+06; got 0 (too small)"),
        ("noise: {torque_variance: 0.2, hold: 0.5 ms}", "output_interval: 0.7 ms", "line 22, column 18, output_interval: needs a whole multiple of the period, 0.0005 s; got 0.0007 s"),
        ("duration: 0.6\n", "duration: 0.6\noutput_interval: 0.1 ms\n", "line 24, column 18, output_interval: needs a whole multiple of the period, 0.0005 s; got 0.0001 s"),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line(old: str, new: str, line: str) -> None:
    assert mistakes(changed(old, new)) == [line]


@pytest.mark.parametrize(("hold", "seconds"), [("0.5 ms", 5e-4), ("1.5 ms", 1.5e-3), ("0.1 s", 0.1)])
def test_noise_is_held_for_whole_periods_and_rows_need_not_fit_it(hold: str, seconds: float) -> None:
    """3 periods of 0.5 ms divide no 5 ms, the default between two rows."""
    s = parse_scenario(changed("hold: 0.5 ms", f"hold: {hold}"))
    assert s.noise is not None
    assert (s.noise.hold, s.output_interval) == (seconds, 0.005)
    noise = resolve(s).noise
    assert noise is not None
    assert noise.hold == seconds


@pytest.mark.parametrize(
    ("rate", "hold"), [("2 kHz", 1e-3), ("500 Hz", 2e-3), ("300 Hz", 1 / 300), ("1.6 kHz", 2 / 1600)]
)
def test_noise_without_a_hold_is_held_for_whole_periods_near_a_millisecond(rate: str, hold: float) -> None:
    s = parse_scenario(changed(", hold: 0.5 ms", "").replace("2 kHz", rate).replace("0.75 ms", "0"))
    assert s.noise is not None
    assert s.noise.hold == hold


@pytest.mark.parametrize(
    ("rate", "interval"),
    [
        (125, 8e-3),
        (250, 4e-3),
        (300, 2 / 300),
        (500, 4e-3),
        (333, 2 / 333),
        (1000, 5e-3),
        (4000, 5e-3),
        (20, 0.05),
    ],
)
def test_the_interval_that_is_left_out_fits_the_rate(rate: float, interval: float) -> None:
    """The multiple of the period nearest to 5 ms; what was resolved loads again and says the same."""
    s = parse_scenario(RIGID.replace("1000", str(rate)))
    assert s.output_interval == interval
    assert abs(s.output_interval * rate - round(s.output_interval * rate)) < 1e-9
    assert parse_scenario(s.to_yaml()) == s


def test_the_interval_that_is_left_out_fits_a_short_run_and_the_noise() -> None:
    assert parse_scenario(RIGID.replace("duration: 1", "duration: 3.2 ms")).output_interval == 0.003
    continuous = RIGID.replace("control: {rate: 1000}\n", "noise: {torque_variance: 1, hold: 3 ms}\n")
    assert parse_scenario(continuous).output_interval == pytest.approx(6e-3, rel=1e-12)
    assert mistakes(RIGID.replace("duration: 1", "duration: 0.2 ms")) == [
        "line 1, column 1, output_interval: needs to be no longer than the duration, 0.0002 s; got 0.001 s (the default)"
    ]


def test_without_a_rate_nothing_sampled_is_allowed() -> None:
    assert mistakes(changed(CONTROL + "\n", "")) == [
        f"line 12, column 10, sensors: {ONLY}",
        f"line 13, column 24, motors.torque_limit: {ONLY}",
        "line 14, column 14, tank.kind: a tank of kind port needs `control`, a rate at which it runs",
        f"line 15, column 10, actions: {ONLY}",
        f"line 17, column 3, gains: {ONLY}",
        f"line 19, column 14, feedforward: {ONLY}",
    ]
    continuous = changed("control: {rate: 1000}\n", "", RIGID.replace("rigid", "impedance"))
    shaped = "shaped_stiffness: {ratio: 1}\n  shaped_inertia: {ratio: 1}\n"
    continuous = changed("target_inertia: {damping_ratio: 0.7}\n", shaped, continuous)
    assert mistakes(continuous + "tank: {trip: 1 mJ, power: 3, braking: 2}\n") == [
        f"line 12, column {column}, tank.{name}: a tank of kind paper without `control` does not use it; "
        f"{kinds} with `control` do; remove it"
        for name, column, kinds in (
            ("trip", 14, "port"),
            ("power", 27, "port, paper"),
            ("braking", 39, "time_domain"),
        )
    ]
    assert parse_scenario(parse_scenario(continuous).to_yaml()).tank == TankSettings().completed("paper")


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("rate: 1000", "rate: 1000, inner_loop: matched", "line 10, column 35, control.inner_loop: the rigid law has no inner loop; take plain"),
        ("duration", "tank: {kind: port}\nduration", "line 11, column 7, tank: only the impedance law has a tank; remove it, or take law type: impedance"),
    ],
)  # fmt: skip
def test_mistakes_with_the_rigid_law(old: str, new: str, line: str) -> None:
    assert mistakes(changed(old, new, RIGID)) == [line]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("torque_limit: robot", "coulomb_friction: [1, 2, 3]", "motors.coulomb_friction does not fit robot 'planar2r'; got 3 numbers; needs one number or 2"),
        ("torque_limit: robot", "viscous_friction: [1]", None),
        ("link_resolution: 0.01 deg", "torque_offset: [1, 2, 3]", "sensors.torque_offset does not fit robot 'planar2r'; got 3 numbers; needs one number or 2"),
        ("torque_limit: robot", "viscous_friction: [1, 2, 3]", "motors.viscous_friction does not fit robot 'planar2r'; got 3 numbers; needs one number or 2"),
        ("follow_velocity: 50 %", "posture: [1, 2, 3]", "actions.posture does not fit robot 'planar2r'; got 3 angles; needs 2 angles in rad"),
        ("follow_velocity: 50 %", "posture_stiffness: [1, 2, 3]", "actions.posture_stiffness does not fit robot 'planar2r'; got 3 numbers; needs one number or 2"),
        ("0.75 ms", "0, fallback: {shaped_stiffness: [1, 2, 3]}", "control.fallback.shaped_stiffness does not fit robot 'planar2r'; got 3 numbers; needs one number or 2"),
        ("0.75 ms", "0, fallback: {shaped_inertia: {ratio: [1, 2, 3]}}", "control.fallback.shaped_inertia does not fit robot 'planar2r'; got 3 numbers; needs one number or 2"),
    ],
)  # fmt: skip
def test_lists_fit_the_robot(old: str, new: str, message: str | None) -> None:
    scenario = parse_scenario(changed(old, new))
    if message is None:
        assert resolve(scenario) is not None
        return
    with pytest.raises(SizeError) as error:
        resolve(scenario)
    assert str(error.value) == message
    assert isinstance(error.value, PassiflexError)


@pytest.mark.parametrize("gravity", ["static", "motor"])
def test_an_observer_that_knows_no_weight_is_refused_where_the_law_carries_it(gravity: str) -> None:
    text = GOOD.replace("gravity: robot", f"gravity: {gravity}").replace(
        "{kind: port}", "{kind: time_domain}"
    )
    with pytest.raises(
        ScenarioError, match=r"tank\.kind: takes the weight that is lifted for energy given away"
    ):
        parse_scenario(text)
