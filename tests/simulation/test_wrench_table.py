"""A wrench by the rows of a table: the same as constant forces in its place, and mistakes with their line."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import passiflex as pf
from passiflex.campaigns.target import complete_data, locate
from passiflex.diagrams.events import spans_of
from passiflex.errors import ScenarioError, SizeError, ValueRangeError
from passiflex.scenarios.forces import wrench_rows
from passiflex.simulation import load_scenario, parse_scenario, resolve, simulate
from passiflex.simulation.batch import simulate_in_lane
from passiflex.texts.number_table import PACKED
from worlds import PLAIN, merged, planar_text, ran, same, world

CONSTANT = [
    {"from": 0.1, "to": 0.2, "force": [5, 0, -3], "moment": [0, 0.2, 0]},
    {"from": 0.2, "to": 0.6, "force": [1, 0, 2]},
]
ROWS = "t,fx,fy,fz,mx,my,mz\n0,5,0,-3,0,.2,0\n0.1,1,0,2,0,0,0\n"
TABLE = {"rows": ROWS, "at": 0.1}


def test_each_row_holds_until_the_next_and_the_last_one_until_the_end(tmp_path: Path) -> None:
    """To the last bit the run of constant forces, from rows, a file, arrays, its own scenario, in a lane, alone or in a list."""
    constant = ran(forces=CONSTANT)
    run = ran(forces=[TABLE])
    assert same(run, constant)
    assert same(ran(forces=TABLE), constant)
    (tmp_path / "push.csv").write_text(ROWS)
    data = merged(yaml.safe_load(PLAIN), {"forces": {"table": "push.csv", "at": 0.1}})
    (tmp_path / "it.yaml").write_text(yaml.safe_dump(data))
    from_file = simulate(load_scenario(tmp_path / "it.yaml"))
    (tmp_path / "push.csv").unlink()
    from_file.save(tmp_path / "run.nc")
    kept = pf.Run.load(tmp_path / "run.nc").scenario
    assert kept is not None
    assert same(simulate(kept), constant)
    force, moment = [[5, 0, -3], [1, 0, 2]], [[0, 0.2, 0], [0, 0, 0]]
    array = pf.wrench_table([0, 0.1], force, moment, at=0.1)
    assert same(simulate(world().changed(forces=[array])), constant)
    lane = simulate_in_lane(resolve(world(forces=TABLE)))
    np.testing.assert_array_equal(lane["q"], simulate_in_lane(resolve(world(forces=CONSTANT)))["q"])


def test_it_is_the_same_in_continuous_time() -> None:
    constant = [CONSTANT[0], {**CONSTANT[1], "to": 0.5}]
    one, other = (simulate(parse_scenario(planar_text(forces=forces))) for forces in (constant, [TABLE]))
    assert same(one, other)


def test_wrenches_add_up_and_rows_beyond_the_end_never_act() -> None:
    """Sums are rounded once: of 0.1, 0.2 and −0.3 nothing is left but what their sum is."""
    forces = [
        {"rows": f"t,fx,fy,fz\n0,{x},0,0\n0.5,{y},0,0\n9,100,0,0\n"}
        for x, y in ((0.1, 1), (0.2, 2), (-0.3, 3))
    ]
    events = resolve(world(forces=forces)).events
    acting = {e.time: e.F_e[0] for e in events}
    assert acting[0.0] == np.float64(2.7755575615628914e-17)
    assert acting[0.5] == 6
    assert max(acting) < 0.6


def test_moments_alone_and_a_long_table() -> None:
    assert wrench_rows("t,mx,my,mz\n0,1,2,3\n").tolist() == [[0, 0, 0, 0, 1, 2, 3]]
    time = np.arange(3000) * 1e-4
    table = pf.wrench_table(time, np.random.default_rng(0).normal(size=(3000, 3)))
    assert table.rows.startswith(PACKED)
    scenario = world().changed(forces=[table])
    assert parse_scenario(scenario.to_yaml(), opens=False) == scenario
    assert len(resolve(scenario).events) == 3000


def test_a_campaign_finds_its_way_into_it() -> None:
    data = complete_data(world(forces=[TABLE, CONSTANT[0]]))
    assert locate(data, "forces.1.at").put(data, 0.2)["forces"][0]["at"] == 0.2
    assert locate(data, "forces.2.force.1").place == ("forces", 1, "force", 0)


def test_a_diagram_has_one_span_for_it() -> None:
    spans = [s for s in spans_of(ran(forces=[TABLE])) if s.kind == "force"]
    assert [(s.start, s.end, s.label) for s in spans] == [(0.1, 0.6, "wrench of a table")]


def mistakes(forces: Any) -> str:
    with pytest.raises(ScenarioError) as refused:
        world(forces=forces)
    (line,) = str(refused.value).splitlines()[1:]
    return line.split(", ", 2)[2]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("", "is empty; needs a line with the names of the columns, as t,x,y,z, and a line for each row"),
        ("t\n0\n", "has a column t only; needs fx,fy,fz or mx,my,mz beside it"),
        ("fx,fy,fz\n0,0,0\n", "has no column t, the time in s; add it"),
        ("t,fx,fy\n0,1,2\n", "has fx, fy without fz; add what is missing"),
        ("time,fx,fy,fz\n0,1,2,3\n", "unknown column 'time'; if it is the time in s, call it t"),
        ("t [s],fx,fy,fz\n0,1,2,3\n", "unknown column 't [s]'; try 't': columns are in SI units, without one"),
        ("t,fx,fy,fz,a\n0,1,2,3,4\n", "unknown column 'a'; known are t, fx,fy,fz, mx,my,mz"),
        ("t,fx,fy,fz\n0,1,2,3\n0,1,1,1\n", "line 3, column t: the time repeats, 0 s after 0 s; sort the rows by t, each instant once"),
        ("t,fx,fy,fz\n2,1,2,3\n1,1,1,1\n", "line 3, column t: the time goes back, 1 s after 2 s; sort the rows by t, each instant once"),
        ("t,fx,fy,fz\n-1,1,2,3\n", "line 2, column t: -1 s is before the start; begin at 0 or later"),
        ("t,fx,fy,fz\n0,1,nan,3\n", "line 2, column fy: got 'nan', which is not finite; leave the row out: what was told last then goes on"),
        ("t,fx,fy,fz\n0,1,,3\n", "line 2, column fy: empty; fill it, or leave the whole row out: what was told last then goes on"),
        ("t,fx,fy,fz\n0,1,x,3\n", "line 2, column fy: expected a number; got 'x'"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_table_is_one_line(rows: str, said: str) -> None:
    between = ", " if said.startswith("line") else ": "
    assert mistakes([CONSTANT[0], {"rows": rows}]) == f"forces[1].table: rows{between}{said}"


@pytest.mark.parametrize(
    ("force", "said"),
    [
        ({"table": "nope.csv"}, "forces[0].table: nope.csv cannot be read: No such file or directory"),
        ({"table": 3}, "forces[0].table: expected the path of a CSV file; got 3"),
        ({"rows": ROWS, "at": 3}, "forces[0].at: needs to be earlier than the end, 0.6 s; got 3 s"),
        ({"rows": ROWS.replace("\n0,", "\n0.05,"), "at": 0.59}, "forces[0].at: needs to be earlier than the end, 0.6 s; got 0.64 s"),
        ({"rows": ROWS, "att": 3}, "forces[0].att: unknown name; try 'at'"),
        ({"frm": 0, "to": 1}, "forces[0].frm: unknown name; try 'from'"),
        (3, "forces[0]: expected a mapping with from, to, force, moment; got 3"),
        ({"from": 0, "to": 0.2, "force": [1, 2]}, "forces[0].force: expected N, 3 numbers; got [1, 2] (2 numbers)"),
    ],
)  # fmt: skip
def test_mistakes_of_an_entry_stand_at_their_place(force: Any, said: str) -> None:
    assert mistakes([force]) == said


def test_a_run_never_opens_the_file() -> None:
    text = yaml.safe_dump(merged(yaml.safe_load(PLAIN), {"forces": [{"table": "push.csv"}]}))
    with pytest.raises(
        ScenarioError, match=r"forces: the table 'push.csv' is not opened; its rows are not here"
    ):
        parse_scenario(text, opens=False)


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(SizeError, match=r"force; got shape \(2, 2\); needs \(2, 3\)"):
        pf.wrench_table([0, 1], np.zeros((2, 2)))
    with pytest.raises(SizeError, match=r"time; got shape \(\)"):
        pf.wrench_table(0.0, np.zeros((1, 3)))
    with pytest.raises(ValueRangeError, match="force; got str; needs an array of numbers"):
        pf.wrench_table([0], "much")  # type: ignore[arg-type]
    with pytest.raises(ScenarioError, match="has a column t only"):
        pf.wrench_table([0, 1])
    with pytest.raises(ScenarioError, match="line 3, column t: the time goes back"):
        pf.wrench_table([1, 0], np.zeros((2, 3)))
