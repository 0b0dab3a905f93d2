"""A scenario on a twin of a robot: as simulated where nothing is added, softly begun and ended where it is."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import passiflex as pf
from cli.shell import Shell
from onboard.test_controller import CONTROL, planar
from passiflex.errors import SimulationError
from passiflex.onboard import ApproachSettings, Sensed, Twin, WatchSettings, run_on

WALL = {"kind": "plane", "point": [0, 0, 0.69], "normal": [0, 0, -1], "stiffness": 5e3}
WORLDS: dict[str, dict[str, Any]] = {
    "ideal": {},
    "push and wall": {"forces": [{"from": 0.3, "to": 0.4, "force": [0, 0, 5]}], "environment": [WALL]},
    "another robot": {"deviations": {"joint_stiffness": -0.2, "link_inertia": 0.1}},
    "noise and sensors": {
        "noise": {"torque_variance": 0.01, "hold": 0.001},
        "sensors": {"link_resolution": 1e-5, "velocity": "differences", "torque_offset": 0.05},
    },
    "it says less": {"sensors": {"says": ["q", "tau_a"], "velocity_filter": 60}},
    "late sensors": {"sensors": {"link_delay": 0.002, "torque_delay": 0.001}},
    "sensors a little late": {"sensors": {"motor_delay": 0.0005, "torque_delay": 0.0023}},
    "noise of positions": {
        "noise": {"torque_variance": 0, "hold": 0.001, "link_deviation": 1e-5, "motor_deviation": 1e-5}
    },
    "two rates": {"control": CONTROL | {"task_rate": 250}},
    "an observer": {"control": CONTROL | {"external_torque": "observer"}},
    "a way and gains": {
        "reference": [{"at": 0.05, "kind": "move", "by": [0.02, 0, 0.02], "duration": 0.2}],
        "gain_changes": [{"at": 0.2, "duration": 0.1, "stiffness": {"translation": 300}}],
        "actions": {"follow_velocity": 1},
    },
    "motors": {"motors": {"coulomb_friction": 0.2, "torque_limit": "robot", "torque_rate_limit": 5000}},
}
GENTLE = WatchSettings(frozen_after=np.inf, soft_start=0.1, soften=0.2)


@pytest.mark.parametrize("name", WORLDS)
def test_a_twin_told_from_outside_does_what_the_simulation_does(name: str) -> None:
    """Readings, command and state, in every period: two loops that share the law and the plant's equations only."""
    scenario = planar(duration=0.5, **WORLDS[name])
    simulated = pf.simulate(scenario)
    ran = run_on(Twin(scenario), scenario, watch=WatchSettings.off(), weight_in_readings=False, paced=False)
    rows = simulated.time.size - 1
    for signal_name in ("commanded_torque", "measured_q", "measured_tau_a", "tank_energy"):
        expected = simulated[signal_name][:rows]
        np.testing.assert_allclose(ran.run[signal_name][:rows], expected, rtol=1e-7, atol=1e-8)
    assert pf.audit(ran.run).verdict == pf.audit(simulated).verdict == "passive"
    assert not ran.stopped


def test_it_begins_and_ends_softly() -> None:
    """With a step of the reference, which is gone over to within 0.2 s: no torque changes by more in a period."""
    scenario, way = planar(duration=0.5), ApproachSettings(ramp=0.2)
    ran = run_on(Twin(scenario), scenario, watch=GENTLE, approach=way, weight_in_readings=False, paced=False)
    assert ran.periods == pytest.approx(700, abs=3)
    assert ran.run.time[-1] == pytest.approx(0.7, abs=0.003)
    assert np.abs(np.diff(ran.run["commanded_torque"], axis=0)).max() < 0.2


def test_it_ends_where_it_is_told_to() -> None:
    calls = iter(range(10_000))
    scenario = planar(duration=0.5)
    ran = run_on(
        Twin(scenario),
        scenario,
        watch=GENTLE,
        weight_in_readings=False,
        paced=False,
        stop=lambda: next(calls) > 200,
    )
    assert ran.stopped
    assert 400 < ran.periods < 410


def test_it_keeps_the_time_of_a_robot_that_does_not_wait() -> None:
    scenario, lines = planar(duration=0.4), list[str]()
    twin = Twin(scenario)
    times: list[float] = []
    write = twin.write

    def timed(torque: np.ndarray) -> None:
        times.append(time.perf_counter())
        write(torque)

    twin.write = timed  # type: ignore[method-assign]
    run_on(twin, scenario, watch=GENTLE, weight_in_readings=False, report=lines.append)
    assert times[-1] - times[0] > 0.999 * (len(times) - 1) * 1e-3  # never early
    assert lines
    assert "periods late" in lines[0]


def test_a_robot_at_another_rate_is_refused() -> None:
    twin = Twin(planar())
    twin.period = 2e-3
    with pytest.raises(SimulationError, match="the robot runs at another rate; got 500 Hz; needs 1000 Hz"):
        run_on(twin, planar())


def test_a_jump_is_gone_over_to_on_a_way() -> None:
    scenario = planar(duration=0.6)
    at_once, gentle = (
        run_on(Twin(scenario), scenario, watch=WatchSettings.off(), approach=ApproachSettings(ramp=ramp),
               weight_in_readings=False, paced=False).run
        for ramp in (0.0, 0.2)
    )  # fmt: skip
    assert at_once["reference_energy"][-1] > 1.5 * gentle["reference_energy"][-1]


def test_the_twin_says_what_its_scenario_says() -> None:
    said = Twin(planar(sensors={"says": ["theta", "dtheta"]})).read()
    assert isinstance(said, Sensed)
    assert [name for name, value in said._asdict().items() if value is not None] == ["theta", "dtheta"]


def test_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scenario = tmp_path / "arm.yaml"
    scenario.write_text(planar(duration=0.3).to_yaml())
    shell = Shell(monkeypatch, capsys)
    made = shell("run", scenario, "--out", tmp_path / "run.nc", "--fast")
    assert (made.status, made.out) == (0, f"wrote {tmp_path / 'run.nc'}\n")
    audited = shell("audit", tmp_path / "run.nc")
    assert audited.status == 0
    assert "judged by what the robot says of itself" in audited.out
    assert "that it does not declare" not in audited.out
    assert "needs one of twin" in shell("run", scenario, "--out", tmp_path / "x.nc", "--robot", "franka").err


def test_ctrl_c_lets_the_arm_go_softly(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scenario = tmp_path / "arm.yaml"
    scenario.write_text(planar(duration=60).to_yaml())
    moves, write = threading.Event(), Twin.write

    def moved(twin: Twin, torque: np.ndarray) -> None:
        if not moves.is_set():  # from here on it is heard
            moves.set()
            threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        write(twin, torque)

    monkeypatch.setattr(Twin, "write", moved)
    made = Shell(monkeypatch, capsys)("run", scenario, "--out", tmp_path / "run.nc")
    assert made.status == 3
    assert "stopped after" in made.out
    run = pf.Run.load(tmp_path / "run.nc")
    assert run.time[-1] < 30
    assert np.abs(run["commanded_torque"][-1]).max() < 1
