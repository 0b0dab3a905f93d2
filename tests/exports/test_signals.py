"""Signals as columns: every number has a name of its own and one unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from passiflex.exports.signals import signals_of
from passiflex.robots.catalogue import read_description
from passiflex.simulation import Run


def made(name: str, dims: tuple[str, ...], shape: tuple[int, ...], unit: str, **attributes: str) -> Run:
    """Return a run of one signal, over four instants."""
    data = xr.Dataset(
        {name: (("time", *dims), np.arange(4.0 * np.prod(shape)).reshape(4, *shape), {"units": unit})},
        {"time": np.arange(4.0), "component": ["fx", "fy", "fz", "mx", "my", "mz"]},
        attributes,
    )
    return Run(data)


@pytest.mark.parametrize(
    ("name", "dims", "shape", "unit", "titles"),
    [
        ("tank_energy", (), (), "J", ["tank_energy [J]"]),
        ("valve", (), (), "1", ["valve [1]"]),
        ("tau_m", ("joint",), (2,), "N m", ["tau_m_1 [N m]", "tau_m_2 [N m]"]),
        (
            "wrench",
            ("component",),
            (6,),
            "N, N m",
            [f"wrench_f{a} [N]" for a in "xyz"] + [f"wrench_m{a} [N m]" for a in "xyz"],
        ),
        ("held_stiffness", ("task_row", "task_column"), (1, 1), "N/m", ["held_stiffness_1_1 [N/m]"]),
        ("tau_m", ("joint",), (2,), "N m or N", ["tau_m_1 [N m or N]", "tau_m_2 [N m or N]"]),
        ("strange", ("joint",), (7,), "a, b", [f"strange_{i} [a, b]" for i in range(1, 8)]),
    ],
)
def test_columns_say_signal_index_and_unit(
    name: str, dims: tuple[str, ...], shape: tuple[int, ...], unit: str, titles: list[str]
) -> None:
    run = made(name, dims, shape, unit)
    (signal,) = signals_of(run)
    assert signal.titles == titles
    np.testing.assert_array_equal(signal.values, run[name].reshape(4, -1))


def test_a_stiffness_has_the_units_of_its_blocks() -> None:
    (signal,) = signals_of(made("K", ("task_row", "task_column"), (6, 6), "N/m, N, N m/rad"))
    units = np.array(signal.units).reshape(6, 6)
    assert set(units[:3, :3].ravel()) == {"N/m"}
    assert set(units[:3, 3:].ravel()) | set(units[3:, :3].ravel()) == {"N"}
    assert set(units[3:, 3:].ravel()) == {"N m/rad"}
    assert signal.columns[7] == "K_2_2"


def test_a_sliding_joint_has_its_own_unit() -> None:
    chain = read_description("planar2r").chain
    slide = chain.joints[1]._replace(kind="prismatic")
    text = replace(chain, joints=(chain.joints[0], slide)).to_urdf()
    (signal,) = signals_of(made("q", ("joint",), (2,), "rad or m", robot_description=text))
    assert signal.titles == ["q_1 [rad]", "q_2 [m]"]


def test_all_signals_over_time_are_there_and_nothing_else(run: Run) -> None:
    names = [signal.name for signal in signals_of(run)]
    assert names == [str(name) for name, v in run.data.data_vars.items() if "time" in v.dims]
    assert "torque_limit" not in names
    titles = [title for signal in signals_of(run) for title in signal.titles]
    assert len(set(titles)) == len(titles)
