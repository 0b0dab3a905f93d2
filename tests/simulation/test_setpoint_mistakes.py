"""What is wrong with a table is said in one line, with its file, the line in it, and what to do."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from passiflex.errors import ScenarioError
from passiflex.scenarios.setpoint_rows import setpoint_rows
from passiflex.simulation import load_scenario, parse_scenario, simulate
from passiflex.texts.number_table import PACKED, packed, parsed, unpacked, written
from passiflex.texts.text_file import UnreadableError
from worlds import PLAIN, merged, planar_text, world

GOOD = "t,x,y,z\n0,0,0,0\n0.1,0.1,0,0\n"
POSE = {"law": {"task": "pose", "stiffness": {"rotation": 10}, "damping": {"rotation": 1}}}


def mistake(folder: Path, text: str | bytes, changes: dict[str, Any] | None = None, **more: Any) -> str:
    path = folder / "go.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    data = merged(yaml.safe_load(PLAIN), {"reference": {"table": "go.csv", **more}})
    (folder / "it.yaml").write_text(yaml.safe_dump(merged(data, changes or {})))
    with pytest.raises(ScenarioError) as refused:
        load_scenario(folder / "it.yaml")
    lines = str(refused.value).splitlines()
    assert len(lines) == 2, lines
    return lines[1].split(": ", 1)[1]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "go.csv: is empty; needs a line with the names of the columns, as t,x,y,z, and a line for each row"),
        ("# nothing\n\n", "go.csv: is empty; needs a line with the names of the columns, as t,x,y,z, and a line for each row"),
        ("t,x,y,z\n", "go.csv, line 1 names columns, and there is no row below"),
        ("0,1,2,3\n1,1,2,3\n", "go.csv, line 1: expected the names of the columns, as t,x,y,z; got '0,1,2,3'; add a first line"),
        ("t;x;y;z\n0;0;0;0\n", "go.csv, line 1: semicolons between the columns; save it with commas between the columns and decimal points"),
        ("t;x;y;z\n0;0,5;0;0\n", "go.csv, line 1: semicolons between the columns and decimal commas; save it with commas between the columns and decimal points"),
        ("t\tx\n0\t0\n", "go.csv, line 1: tabs between the columns; save it with commas between the columns and decimal points"),
        ("t,x,x,z\n0,0,0,0\n", "go.csv, line 1: column 'x' is there twice; remove one"),
        ("t,x,y,z,,\n0,0,0,0,,\n", "go.csv, line 1: two columns without a name; remove one"),
        ("t,x,y\n0,0,0\n", "go.csv: has x, y without z; add what is missing"),
        ("x,y,z\n0,0,0\n", "go.csv: has no column t, the time in s; add it"),
        ("t,x,y,z\0\n0,0,0,0\n", "go.csv, line 1: not a text; save the table as CSV"),
        ("t\n0\n", "go.csv: has a column t only; needs x,y,z, an orientation or gains beside it"),
        ("t,x,y,z,kxx\n0,0,0,0,1\n", "go.csv: unknown column 'kxx'; try 'kx'"),
        ("t,x,y,z,a\n0,0,0,0,1\n", "go.csv: unknown column 'a'; known are t, x,y,z, qx..qw, rx..rz, kx.., dx.."),
        ("t [s],x,y,z\n0,0,0,0\n", "go.csv: unknown column 't [s]'; try 't': columns are in SI units, without one"),
        ("# c\nt,x,y,z\n0,0,0,0\n\n0.1,,0,0\n", "go.csv, line 5, column x: empty; fill it, or leave the whole row out: what was told last then goes on"),
        ("t,x,y,z\n0,0,nan,0\n", "go.csv, line 2, column y: got 'nan', which is not finite; leave the row out: what was told last then goes on"),
        ("t,x,y,z\n0,0,0,-inf\n", "go.csv, line 2, column z: got '-inf', which is not finite; leave the row out: what was told last then goes on"),
        ("t,x,y,z\n0,0,here,0\n", "go.csv, line 2, column y: expected a number; got 'here'"),
        ("t,x,y,z\n0,0,0\n", "go.csv, line 2: 3 cells, but 4 columns have a name"),
        ("t,x,y,z\n0,0,0,5,0,0\n", "go.csv, line 2: 6 cells, but 4 columns have a name; with decimal commas? write 0.1, not 0,1"),
        ("t,x,y,z\n-1,0,0,0\n", "go.csv, line 2, column t: -1 s is before the start; begin at 0 or later"),
        ("t,x,y,z\n0,0,0,0\n0.2,0,0,0\n0.1,0,0,0\n", "go.csv, line 4, column t: the time goes back, 0.1 s after 0.2 s; sort the rows by t, each instant once"),
        ("t,x,y,z\n0,0,0,0\n0,0,0,0\n", "go.csv, line 3, column t: the time repeats, 0 s after 0 s; sort the rows by t, each instant once"),
        ("t,vx,vy,vz\n0,0,0,0\n", "go.csv: has vx,vy,vz without x,y,z; add it, or remove vx,vy,vz"),
        ("t,x,y,z,k11,kx\n0,0,0,0,1,1\n", "go.csv: has both k11 and k11: a matrix is given in one way; remove one"),
        ("t,kx,ky\n0,1,1\n", "go.csv: has kx, ky without kz; add what is missing"),
        ("t,kx,ky,kz\n0,100,100,-1\n", "go.csv, line 2: K_x is not positive definite, smallest eigenvalue -1; needs > 0 in every direction that law.stiffness holds"),
        ("t,dx,dy,dz\n0,10,10,10\n1,10,0,10\n", "go.csv, line 3: D_x is not positive definite, smallest eigenvalue 0; needs > 0 in every direction that law.stiffness holds"),
        ("t,k11,k12,k13,k21,k22,k23,k31,k32,k33\n0,9,1,0,0,9,0,0,0,9\n", "go.csv, line 2: K_x is not symmetric, by 1; needs k12 = k21 and so on"),
        ("t,kx,ky,kz,krx,kry,krz\n0,9,9,9,1,1,1\n", "go.csv: has gains of 6 directions; the task has 3: needs kx,ky,kz, or k11..k33"),
        ("t,rx,ry,rz\n0,0,0,1\n", "a position task has no orientation; remove it"),
        (b"\x89PNG\r\n", "go.csv cannot be read: not UTF-8 text"),
        (b"t,x,y,z\n0,0,0,\xff\n", "go.csv cannot be read: not UTF-8 text"),
    ],
)  # fmt: skip
def test_a_mistake_of_a_table_names_its_line_and_what_to_do(
    tmp_path: Path, text: str | bytes, said: str
) -> None:
    assert mistake(tmp_path, text) == said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,qx,qy,qz,qw\n0,0,0,0,2\n", "go.csv, line 2: the quaternion qx,qy,qz,qw has the length 2; divide it by its length, or use rx,ry,rz"),
        ("t,qx,qy,qz,qw\n0,0,0,0,0\n", "go.csv, line 2: the quaternion qx,qy,qz,qw has the length 0; divide it by its length, or use rx,ry,rz"),
        ("t,qx,qy,qz,qw,rx,ry,rz\n0,0,0,0,1,0,0,0\n", "go.csv: has both qx..qw and rx..rz: an orientation is given in one way; remove one"),
        ("t,x,y,z,wx,wy,wz\n0,0,0,0,1,0,0\n", "go.csv: has wx,wy,wz without an orientation, qx..qw or rx..rz; add it, or remove wx,wy,wz"),
        ("t,kx,ky,kz\n0,9,9,9\n", "go.csv: has gains of 3 directions; the task has 6: needs kx,ky,kz,krx,kry,krz, or k11..k66"),
    ],
)  # fmt: skip
def test_a_mistake_of_a_table_of_poses(tmp_path: Path, text: str, said: str) -> None:
    assert mistake(tmp_path, text, POSE) == said


def test_a_free_direction_stays_free_in_a_table(tmp_path: Path) -> None:
    free = {"law": {"task": "pose", "stiffness": {"rotation": [5, 5, 0]}, "damping": {"rotation": [1, 1, 0]}}}
    names = "t,kx,ky,kz,krx,kry,krz\n"
    said = "go.csv, line 2: K_x is not 0 in a direction that law.stiffness leaves free; write 0 there"
    assert mistake(tmp_path, names + "0,9,9,9,1,1,1\n", free) == said
    world(**free, reference={"rows": names + "0,9,9,9,1,1,0\n"})


def test_gains_of_a_table_need_control_and_are_the_only_ones(tmp_path: Path) -> None:
    gains = "t,kx,ky,kz\n0,9,9,9\n"
    said = mistake(tmp_path, gains, {"control": None, "tank": None})
    assert said == "go.csv: has gains, which need `control`; remove k.. and d.."
    change = [{"at": 0.1, "duration": 0.1, "stiffness": {"translation": 80}}]
    said = mistake(tmp_path, gains, {"gain_changes": change})
    assert said == "a table of the reference has gains too; keep one of the two"


def test_what_the_entries_of_a_table_refuse(tmp_path: Path) -> None:
    twist = "t,x,y,z,vx,vy,vz\n0,0,0,0,0,0,0\n"
    said = "a velocity, vx..vz or wx..wz, is passed with between: smooth, not in a stream; got "
    assert mistake(tmp_path, twist) == said + "linear"
    assert mistake(tmp_path, twist, between="smooth", stream={}) == said + "a stream"
    smooth = "a stream does not know the next row; needs held, linear or minimum_jerk"
    assert mistake(tmp_path, GOOD, between="smooth", stream={}) == smooth
    assert mistake(tmp_path, GOOD, relative=1) == "expected true or false; got 1"
    assert mistake(tmp_path, GOOD, between="hold") == "unknown word 'hold'; try 'held'"
    assert mistake(tmp_path, GOOD, beetween="held") == "unknown name; try 'between'"
    lost = "expected one number, ≥ 0, ≤ 0.99; got 1 (too large)"
    assert mistake(tmp_path, GOOD, stream={"lost": 1}) == lost
    assert mistake(tmp_path, GOOD, table="no.csv") == "no.csv cannot be read: No such file or directory"
    assert mistake(tmp_path, GOOD, table=3) == "expected the path of a CSV file; got 3"
    assert mistake(tmp_path, GOOD, table=".").endswith("cannot be read: Is a directory")
    with pytest.raises(ScenarioError, match="missing: path of a CSV file"):
        world(reference=[{"kind": "table"}])
    with pytest.raises(ScenarioError, match="expected the text of a table; got 3"):
        world(reference={"rows": 3})


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_and_windows_lines_are_read(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "go.csv").write_bytes(GOOD.replace("\n", "\r\n").encode(encoding))
    (tmp_path / "it.yaml").write_text(planar_text(reference={"table": "go.csv", "relative": True}))
    scenario = load_scenario(tmp_path / "it.yaml")
    assert parse_scenario(scenario.to_yaml()) == scenario


@given(
    st.lists(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3), min_size=1)
)
def test_what_is_written_is_read_to_the_last_bit_packed_or_not(rows: list[list[float]]) -> None:
    text = written(("a", "b", "c"), np.array(rows)) * 1
    for kept in (text, packed(text + "#" * 30_000)):
        np.testing.assert_array_equal(parsed(unpacked(kept)).numbers, rows)


def test_damaged_packed_rows_are_refused() -> None:
    for text in (PACKED + "!!", PACKED + "AAAA", PACKED, packed(GOOD + "#" * 30_000)[:-8]):
        with pytest.raises(UnreadableError, match="the packed rows are damaged; give the table's file anew"):
            unpacked(text)
    with pytest.raises(ScenarioError, match="the packed rows are damaged"):
        world(reference={"rows": PACKED + "!!"})


def test_a_table_that_cannot_be_kept_is_refused() -> None:
    rows = np.random.default_rng(0).normal(size=(90_000, 5))
    with pytest.raises(UnreadableError, match=r"try fewer rows, or numbers of six digits"):
        packed(written("abcde", rows))


@given(
    st.text(max_size=200)
    | st.lists(
        st.sampled_from(["t", "x", "y", "z", "k11", ",", "\n", "0", "1", "nan", "-", "1e999", '"', "#"]),
        max_size=40,
    ).map("".join)
)
@settings(max_examples=400)
def test_no_text_breaks_the_reader(text: str) -> None:
    try:
        setpoint_rows(text)
    except (ValueError, UnreadableError) as error:
        said = str(error)
    else:
        said = "nothing"
    assert said
    assert "\n" not in said


@pytest.mark.parametrize(("rows", "number"), [(45_000, "{!r}"), (100_000, "{:.6g}")])
def test_as_many_rows_as_the_documentation_says_are_kept_and_hardly_more(rows: int, number: str) -> None:
    """Of random numbers, which no packing makes much smaller."""
    rng = np.random.default_rng(0)
    lines = [
        ",".join(map(number.format, (k / 1000, *row)))
        for k, row in enumerate(rng.normal(size=(rows, 6)).tolist())
    ]
    assert packed("\n".join(lines)).startswith(PACKED)
    with pytest.raises(UnreadableError, match=r"at most 3\.5 MB can be kept"):
        packed("\n".join([*lines, *lines[: rows // 10]]))


@pytest.mark.parametrize("among", [True, False])
def test_a_run_does_not_open_the_table_that_its_scenario_names(tmp_path: Path, *, among: bool) -> None:
    """Whoever made the run may have named any file of whoever looks at it; the rows of a run are in it."""
    secret = tmp_path / "secret.csv"
    secret.write_text("t,x,y,z\n0,0,0,0\n1,0.1,0,0\n", encoding="utf-8")
    run = simulate(world(reference={"table": str(secret), "relative": True}))
    assert run.scenario is not None
    data = yaml.safe_load(str(run.data.attrs["scenario"]))
    named = {"table": str(secret), "relative": True}
    data["reference"] = (
        [{"kind": "hold", "at": 0.1}, {"kind": "table", "at": 0.2, **named}] if among else named
    )
    text = yaml.safe_dump(data)
    assert parse_scenario(text).reference
    run.data.attrs["scenario"] = text
    assert run.scenario is None
    with pytest.raises(ScenarioError, match=r"reference: the table .* is not opened; its rows are not here"):
        parse_scenario(text, opens=False)
