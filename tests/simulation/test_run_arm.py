"""The arm of a run: from its own description, or from the catalogue and the tool of its configuration."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from passiflex.robots.catalogue import read_description
from passiflex.robots.frames import world_frames
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run, parse_scenario, simulate
from worlds import PLANAR

SCENARIO = f"{PLANAR}tool: {{position: [0.05, 0, 0.02], rotation_vector: [0, 0.3, 0]}}\n"


@lru_cache
def simulated() -> Run:
    return simulate(parse_scenario(SCENARIO))


def changed(**attributes: str | None) -> Run:
    """Return the run with other attributes; None takes one away."""
    data = simulated().data.copy()
    data.attrs = {k: v for k, v in (data.attrs | attributes).items() if v is not None}
    return Run(data)


@pytest.mark.parametrize("description", ["own", None, "<robot", "no URDF", "<robot>" + "<!--" * 100_000])
def test_the_arm_puts_the_end_effector_where_it_was_recorded(description: str | None) -> None:
    run = simulated() if description == "own" else changed(robot_description=description)
    chain = chain_of(run)
    assert chain is not None
    assert chain.name == "planar2r"
    frames = world_frames(chain, run["q"])
    np.testing.assert_allclose(frames.position[:, -1], run["position"], atol=1e-12)
    np.testing.assert_allclose(frames.rotation[:, -1], run["rotation"], atol=1e-12)


def test_a_description_of_another_arm_is_not_believed() -> None:
    """The recorded positions decide: here the catalogue's arm without the tool, and one of seven joints."""
    own = chain_of(simulated())
    assert own is not None
    for name in ("planar2r", "iiwa14"):
        other = read_description(name).chain.to_urdf()
        assert chain_of(changed(robot_description=other, scenario="")) is None
        believed = chain_of(changed(robot_description=other))  # the configuration has the tool
        assert believed is not None
        np.testing.assert_allclose(believed.tip_xyz, own.tip_xyz, atol=1e-15)


@pytest.mark.parametrize(
    "attributes",
    [
        {"scenario": "robot: somebody's"},
        {"scenario": "robot: ../../etc/robot.yaml"},
        {"scenario": "robot: iiwa14"},
        {"scenario": "tool: {position: here}"},
        {"scenario": "{"},
        {"scenario": "a text"},
        {"scenario": "robot: /dev/zero"},
        {"scenario": 'robot: "/a\\0b.yaml"'},
        {"scenario": "[" * 5000},
        {"scenario": "robot: 2001-99-99"},
        {"scenario": "robot: " + "9" * 5000},
        {
            "scenario": "a: &a [1]\n"
            + "".join(f"b{i}: &b{i} [{', '.join([f'*b{i - 1}' if i else '*a'] * 9)}]\n" for i in range(9))
        },
    ],
)
def test_a_run_that_does_not_say_what_it_was_has_no_arm(attributes: dict[str, str | None]) -> None:
    assert chain_of(changed(robot_description=None, **attributes)) is None


def test_rows_and_signals_that_are_missing_do_not_hide_the_arm() -> None:
    data = simulated().data.copy(deep=True)
    data["q"][:3] = np.nan
    assert chain_of(Run(data)) is not None
    data["position"][:] = np.nan
    assert chain_of(Run(data)) is not None
    assert chain_of(Run(data.drop_vars("position"))) is not None
    assert chain_of(Run(data.drop_vars("q"))) is None


def test_a_tool_of_a_description_is_kept() -> None:
    chain = chain_of(simulated())
    assert chain is not None
    again = chain_of(changed(robot_description=replace(chain, name="x").to_urdf()))
    assert again is not None
    np.testing.assert_array_equal(again.tip_xyz, chain.tip_xyz)


def test_a_tool_turns_with_the_flange_that_carries_it(tmp_path: Path) -> None:
    """The robot's own end effector is turned already; a file that a run names is not opened for it."""
    data = Path(str(resources.files("passiflex.robots") / "data"))
    fixed = '<child link="tool"/>\n    <origin xyz="0.4 0 0" rpy="0 0 0"/>'
    urdf = (data / "planar2r.urdf").read_text(encoding="utf-8")
    assert fixed in urdf
    turned = urdf.replace(fixed, fixed.replace("0 0 0", "0.3 -0.4 0.9"))
    (tmp_path / "planar2r.urdf").write_text(turned, encoding="utf-8")
    robot = tmp_path / "turned.yaml"
    robot.write_text((data / "planar2r.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    run = simulate(parse_scenario(SCENARIO.replace("robot: planar2r", f"robot: {robot}")))
    own, named = chain_of(run), read_description(robot).chain.with_tool((0.05, 0, 0.02), (0, 0.3, 0))
    del run.data.attrs["robot_description"]
    assert chain_of(run) is None
    assert own is not None
    for chain in (own, named):
        frames = world_frames(chain, run["q"])
        np.testing.assert_allclose(frames.position[:, -1], run["position"], atol=1e-12)
        np.testing.assert_allclose(frames.rotation[:, -1], run["rotation"], atol=1e-12)
