"""What clock, sensors and motors do to a run: each acts, as it says; switched off it is as if it were not there."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy import stats

from passiflex.simulation import Run, parse_scenario, simulate
from worlds import PERIOD, merged, ran, same

UNLIKELY = 1e-6
"""Probability at which a statistical test of this file fails though all is well; the seeds are fixed."""
PLAIN: dict[str, Any] = {
    "law": {"gravity": "static", "shaped_stiffness": {"ratio": 1.5}, "shaped_inertia": {"ratio": 0.5}},
    "control": {"external_torque": "measured"},
    "tank": {"initial": 20},
    "reference": [{"at": 0.1, "kind": "step", "by": [-0.3, 0, 0.3]}],
    "forces": [{"from": 0.3, "to": 0.4, "force": [5, 0, -5]}],
    "duration": 0.5,
}
JOINT_RESOLUTION, MOTOR_RESOLUTION, FILTER, BANDWIDTH = 1e-4, 1e-5, 50.0, 80.0
SLOW = {"law": {"shaped_inertia": {"ratio": 2}}}
DIFFERENCES = {"sensors": {"velocity": "differences"}}
NOISE = {"noise": {"torque_variance": 0.25, "hold": PERIOD}}
EFFECTS: dict[str, dict[str, Any]] = {
    "whole delay": {"control": {"delay": 1e-3}},
    "fractional delay": {"control": {"delay": 0.4e-3}},
    "jitter": {"control": {"jitter": 0.7e-3}},
    "slow": SLOW,
    "missed": {"control": {"missed": 0.3}},
    "link_resolution": {"sensors": {"link_resolution": JOINT_RESOLUTION}},
    "motor_resolution": {"sensors": {"motor_resolution": MOTOR_RESOLUTION}},
    "velocity": DIFFERENCES,
    "torque_bandwidth": {"sensors": {"torque_bandwidth": BANDWIDTH}},
    "wrench_bandwidth": {"sensors": {"wrench_bandwidth": BANDWIDTH}},
    "noise": NOISE,
    "torque_limit": {"motors": {"torque_limit": "robot"}},
    "torque_rate_limit": {"motors": {"torque_rate_limit": 2000}},
    "coulomb_friction": {"motors": {"coulomb_friction": [2, 1]}},
    "viscous_friction": {"motors": {"viscous_friction": 3}},
    "drag": {"drags": [{"from": 0.1, "to": 0.5, "viscous": 5}]},
    "feedforward": {"feedforward": [{"from": 0.2, "to": 0.4, "force": [3, 0, 0]}]},
    "gains": {"gains": [{"at": 0.2, "duration": 0.1, "stiffness": {"translation": 250}}]},
    "joint_stiffness": {"model_errors": {"joint_stiffness": 0.3}},
    "motor_inertia": {"model_errors": {"motor_inertia": 0.3}},
    "link_inertia": {"model_errors": {"link_inertia": 0.3}},
}
ZERO = (0.0, 0.0, 0.0)
OFF: dict[str, dict[str, Any]] = {
    "control": {"control": {"delay": 0.0, "jitter": 0.0, "missed": 0.0}},
    "sensors": {
        "sensors": {
            "link_resolution": 0.0, "motor_resolution": 0.0, "velocity": "true",
            "velocity_filter": 50.0, "torque_bandwidth": ".inf", "wrench_bandwidth": "inf Hz",
        }
    },
    "motors": {
        "motors": {
            "torque_limit": "none", "torque_rate_limit": ".inf", "coulomb_friction": 0.0,
            "viscous_friction": [0.0, 0.0], "friction_width": 5.0,
        }
    },
    "noise": {"noise": {"torque_variance": 0.0, "hold": PERIOD}},
    "model_errors": {"model_errors": dict.fromkeys(["joint_stiffness", "joint_damping", "motor_inertia"], 0.0)},
    "actions": {"actions": {"posture_stiffness": 0.0, "posture": [0.1, 0.2], "follow_velocity": 0.0}},
    "feedforward": {"feedforward": [{"from": 0.1, "to": 0.5, "force": ZERO}]},
    "drags": {"drags": [{"from": 0.1, "to": 0.5}]},
    "gains": {"gains": [{"at": 0.1, "duration": 0.2, "stiffness": {"translation": 200}}]},
}  # fmt: skip


@lru_cache
def effect(*names: str) -> Run:
    """Return the run with these effects."""
    changes = PLAIN
    for name in names:
        changes = merged(changes, EFFECTS[name])
    run = ran(**changes)
    assert not run.failure
    return run


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_acts(name: str) -> None:
    """The arm moves in another way, by more than rounding does."""
    assert np.abs(effect(name)["q"] - effect()["q"]).max() > 1e-8


@pytest.mark.parametrize("section", OFF)
def test_switched_off_is_as_if_it_were_not_there(section: str) -> None:
    assert same(ran(**merged(PLAIN, OFF[section])), effect())


def test_the_port_tank_asks_no_formula_for_the_damping() -> None:
    """An error in D is seen by nobody: not by the plain law, which only claims by it, nor by the port tank."""
    wrong = {"model_errors": {"joint_damping": 0.9}}
    assert same(ran(**merged(PLAIN, wrong)), effect())
    paper = {"tank": {"kind": "paper"}}
    right = ran(**merged(PLAIN, paper))
    assert not np.array_equal(ran(**merged(PLAIN, paper | wrong))["tank_energy"], right["tank_energy"])


# The clock


@pytest.mark.parametrize(("delay", "late"), [(0, 0), (0.4e-3, 1), (1e-3, 1), (1.4e-3, 2), (2e-3, 2)])
def test_a_command_is_in_force_from_its_arrival_on(delay: float, late: int) -> None:
    """At the samples one sees the command of the last sample that is at least the delay ago."""
    run = ran(**merged(PLAIN, SLOW | {"control": {"delay": delay}}))
    asked, given = run["commanded_torque"], run["tau_m"]
    np.testing.assert_array_equal(given[late:], asked[: len(asked) - late])
    np.testing.assert_array_equal(given[:late], np.broadcast_to(given[0], given[:late].shape))


def test_a_command_that_is_late_at_random_is_one_of_the_last() -> None:
    """Late by up to 1.5 periods, two of three commands are in force at the next sample, all at the one after."""
    run = ran(**merged(PLAIN, SLOW | {"control": {"jitter": 1.5e-3}}))
    asked, given = run["commanded_torque"], run["tau_m"]
    last, before = ((given[2:] == other).all(axis=1) for other in (asked[1:-1], asked[:-2]))
    assert (last | before).all()
    moving = (asked[1:-1] != asked[:-2]).all(axis=1)
    share, count = last[moving].mean(), moving.sum()
    assert abs(share - 2 / 3) < stats.norm.isf(UNLIKELY) * np.sqrt(2 / 9 / count)


def test_in_a_missed_period_nothing_is_read_and_nothing_said() -> None:
    """Signals and tank stay as they were; 30 % are missed, within what chance allows."""
    run = effect("missed")
    moving = run.time[1:] > 0.11
    missed = (np.diff(run["measured_q"], axis=0) == 0).all(axis=1) & moving
    for name in (
        "measured_tau_a",
        "commanded_torque",
        "tank_energy",
        "measured_port_energy",
        "governed_position",
    ):
        np.testing.assert_array_equal(rows(run[name])[1:][missed], rows(run[name])[:-1][missed])
    assert (np.diff(run["q"], axis=0)[missed] != 0).any(axis=1).all()
    limits = stats.binom.ppf([UNLIKELY, 1 - UNLIKELY], moving.sum(), 0.3)
    assert limits[0] <= missed.sum() <= limits[1]


def rows(signal: np.ndarray) -> np.ndarray:
    return signal.reshape(len(signal), -1)


# Sensors


@pytest.mark.parametrize(
    ("name", "signal", "resolution"),
    [("link_resolution", "q", JOINT_RESOLUTION), ("motor_resolution", "theta", MOTOR_RESOLUTION)],
)
def test_a_reading_is_the_nearest_multiple_of_the_resolution(
    name: str, signal: str, resolution: float
) -> None:
    run = effect(name)
    error = run[f"measured_{signal}"] - run[signal]
    assert np.abs(error).max() <= resolution / 2 * (1 + 1e-9)
    assert np.abs(error).max() > 0.4 * resolution
    steps = run[f"measured_{signal}"] / resolution
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)
    for other in {"q", "theta", "dq", "dtheta", "tau_a"} - {signal}:
        np.testing.assert_array_equal(run[f"measured_{other}"], run[other])


@pytest.mark.parametrize("bandwidth", [None, FILTER])
def test_velocities_are_low_passed_differences_of_readings(bandwidth: float | None) -> None:
    sensors = {"velocity": "differences", "link_resolution": JOINT_RESOLUTION, "velocity_filter": bandwidth}
    run = ran(**merged(PLAIN, {"sensors": sensors}))
    for position, velocity in (("measured_q", "measured_dq"), ("measured_theta", "measured_dtheta")):
        rate = np.diff(run[position], axis=0, prepend=run[position][:1]) / PERIOD
        np.testing.assert_allclose(run[velocity], low_passed(rate, bandwidth), rtol=0, atol=1e-9)
    assert np.abs(run["measured_dq"] - run["dq"]).max() > 0.05


def low_passed(signal: np.ndarray, bandwidth: float | None) -> np.ndarray:
    """Return x + (1 − e^(−ωT)) (u − x), from period to period."""
    share = 1 - np.exp(-2 * np.pi * bandwidth * PERIOD) if bandwidth else 1.0
    out = np.array(signal)
    for k in range(1, len(out)):
        out[k] = out[k - 1] + share * (signal[k] - out[k - 1])
    return out


def test_a_torque_sensor_is_a_low_pass_of_the_truth() -> None:
    run = effect("torque_bandwidth")
    np.testing.assert_allclose(run["measured_tau_a"], low_passed(run["tau_a"], BANDWIDTH), rtol=0, atol=1e-9)
    assert np.abs(run["measured_tau_a"] - run["tau_a"]).max() > 0.1


def test_noise_has_its_variance_and_is_white() -> None:
    """Of 501 samples for each of two joints: variance by χ², correlations of neighbours and of the joints by 1/√N."""
    noise = effect("noise")["measured_tau_a"] - effect("noise")["tau_a"]
    square = (noise**2).sum() / NOISE["noise"]["torque_variance"]
    low, high = stats.chi2.ppf([UNLIKELY, 1 - UNLIKELY], noise.size)
    assert low < square < high
    z = stats.norm.isf(UNLIKELY)
    assert abs(noise.mean()) < z * 0.5 / np.sqrt(noise.size)
    assert abs(np.corrcoef(noise.T)[0, 1]) < z / np.sqrt(len(noise))
    for joint in noise.T:
        assert abs(np.corrcoef(joint[1:], joint[:-1])[0, 1]) < z / np.sqrt(len(joint))


# Motors


def test_the_torque_limit_is_kept() -> None:
    limit = np.array([100.0, 50.0])
    run, free = effect("torque_limit"), effect()
    assert (np.abs(free["tau_m"]) > limit).any()
    assert (np.abs(run["tau_m"]) <= limit).all()
    assert (np.abs(run["tau_m"]) == limit).any()
    np.testing.assert_array_equal(run["tau_m"], np.clip(run["commanded_torque"], -limit, limit))


@pytest.mark.parametrize("missed", [0.0, 0.3])
def test_the_torque_rate_limit_is_kept(missed: float) -> None:
    """From one command to the next, and after missed periods by as many more."""
    rate = EFFECTS["torque_rate_limit"]["motors"]["torque_rate_limit"]
    run = ran(**merged(PLAIN, EFFECTS["torque_rate_limit"] | {"control": {"missed": missed}}))
    given = run["tau_m"]
    ran_at = np.flatnonzero(np.append(True, (np.diff(run["measured_q"], axis=0) != 0).any(axis=1)))
    moved = np.abs(np.diff(given[ran_at], axis=0)) / np.diff(ran_at)[:, None]
    assert moved.max() <= rate * PERIOD * (1 + 1e-9)
    assert np.isclose(moved, rate * PERIOD).sum() > 20
    assert np.abs(np.diff(effect()["tau_m"], axis=0)).max() > 10 * rate * PERIOD


# Running again

ALL = ("slow", "fractional delay", "jitter", "missed", "link_resolution", "velocity", "noise", "torque_limit")


def test_the_same_seed_gives_the_same_run_and_so_does_its_file(tmp_path: Path) -> None:
    """Bit for bit, from the configuration that lies in the file, and also from its text reordered by YAML."""
    run = effect(*ALL)
    loaded = Run.load(run.save(tmp_path / "run.nc"))
    assert same(loaded, run)
    configuration = loaded.data.attrs["scenario"]
    assert same(simulate(parse_scenario(configuration)), run)
    reordered = yaml.safe_dump(yaml.safe_load(configuration))
    assert reordered != configuration
    assert same(simulate(parse_scenario(reordered)), run)
    other = simulate(parse_scenario(configuration).model_copy(update={"seed": 1}))
    assert not np.array_equal(other["measured_tau_a"], run["measured_tau_a"])
