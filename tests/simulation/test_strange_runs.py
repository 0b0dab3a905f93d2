"""A run that a stranger made is read from its own file alone, and in bounded memory, or refused in one line."""

from __future__ import annotations

import json
import shutil
import zlib
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from passiflex.diagrams import ideal_motion, marks_of
from passiflex.errors import RunFileError, SizeError, ValueRangeError
from passiflex.reports import report_text
from passiflex.reports.facts import shown_configuration
from passiflex.reports.metrics import metrics_header
from passiflex.runs import run_bounds
from passiflex.runs.run import JOINT_PARAMETERS
from passiflex.runs.run_arm import chain_of, problem_of, robot_of
from passiflex.runs.run_attributes import KINDS
from passiflex.runs.salvaged import salvage
from passiflex.simulation import Run, parse_scenario, resolve, simulate
from worlds import PLANAR


@lru_cache
def made() -> Run:
    return simulate(parse_scenario(PLANAR))


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made().save(tmp_path_factory.mktemp("saved") / "run.nc")


@pytest.fixture
def path(saved: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(saved, tmp_path / "run.nc"))


def refusal(path: Path) -> str:
    """Return the one line with which a run is refused, whoever reads it."""
    said = set()
    for read in (Run.load, salvage):
        with pytest.raises(RunFileError) as error:
            read(path)
        said.add(str(error.value))
    (line,) = said
    assert line.startswith(f"{path} is not read; got ")
    assert "\n" not in line
    return line


ZEROS = {"shape": (10**10, 10**4), "dtype": "f8", "chunks": (1000, 100), "compression": "gzip"}


def external_link(file: h5py.File, at: Path) -> None:
    file["theirs"] = h5py.ExternalLink("/etc/passwd", "/")


def soft_link(file: h5py.File, at: Path) -> None:
    file["again"] = h5py.SoftLink("/q")


def dangling_link(file: h5py.File, at: Path) -> None:
    file["again"] = h5py.SoftLink("/nowhere")


def virtual(file: h5py.File, at: Path) -> None:
    layout = h5py.VirtualLayout((3,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(at / "other.h5"), "x", (3,))
    file.create_virtual_dataset("theirs", layout)


def elsewhere(file: h5py.File, at: Path) -> None:
    file.create_dataset("theirs", (4,), "u1", external=[("/dev/zero", 0, 4)])


@pytest.mark.parametrize(
    ("change", "got"),
    [
        (external_link, "a link to another place, 'theirs'"),
        (soft_link, "a link to another place, 'again'"),
        (dangling_link, "a link to another place, 'again'"),
        (virtual, "'theirs', whose numbers are in another file"),
        (elsewhere, "'theirs', whose numbers are in another file"),
        (lambda file, _: file.create_dataset("zeros", **ZEROS), "more than 1.1 GB in 0."),
        (lambda file, _: file.create_dataset("zeros", (2**28,), "f8"), "more than 1.1 GB in 0."),
        (
            lambda file, _: file.create_dataset("text", (10**7,), h5py.string_dtype()),
            "more than 1.1 GB in 0.",
        ),
        (
            lambda file, _: file.create_dataset("large", (8,), "f8", chunks=(2**26,), maxshape=(None,)),
            "'large', packed in an unusual way",
        ),
    ],
)
def test_what_is_elsewhere_or_endless_is_refused(path: Path, tmp_path: Path, change: Any, got: str) -> None:
    with h5py.File(path, "a") as file:
        change(file, tmp_path)
    assert f"got {got}" in refusal(path)


def test_a_chunk_that_unpacks_into_far_more_than_its_numbers_is_refused(path: Path) -> None:
    """The library would make room for all of it: 300 kB are 300 MB of zeros."""
    packer = zlib.compressobj(9)
    packed = b"".join(packer.compress(bytes(2**20)) for _ in range(300)) + packer.flush()
    with h5py.File(path, "a") as file:
        data = file.create_dataset("bomb", (1000,), "f8", chunks=(1000,), compression="gzip")
        data.id.write_direct_chunk((0,), packed)
    assert "got 'bomb', a part of which unpacks into more than it should" in refusal(path)


def test_numbers_that_are_packed_twice_are_refused(path: Path) -> None:
    with h5py.File(path, "a") as file:
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_chunk((1000,))
        for _ in range(2):
            plan.set_deflate(9)
        h5py.h5d.create(file.id, b"twice", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((1000,)), plan)
    assert "got 'twice', packed in an unusual way" in refusal(path)


def test_chunks_that_are_large_and_honest_are_read(path: Path) -> None:
    noise = np.random.default_rng(1).normal(size=(made().time.size, 10_000))
    with h5py.File(path, "a") as file:
        data = file.create_dataset("noise", data=noise, chunks=noise.shape, compression="gzip", shuffle=True)
        assert data.id.get_storage_size() > run_bounds.SUSPECT
    run_bounds.require_bounded(path)


@pytest.mark.parametrize("where", ["/", "q"])
def test_attributes_are_bounded(path: Path, where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with h5py.File(path, "a") as file:
        file[where].attrs["numbers"] = np.zeros(7000)
    monkeypatch.setattr(run_bounds, "ATTRIBUTE", 50_000)
    assert "got an attribute of 0.056 MB, 'numbers'" in refusal(path)
    monkeypatch.undo()
    monkeypatch.setattr(run_bounds, "ATTRIBUTES", 50_000)
    assert "more than 1.1 GB" in refusal(path)


def test_groups_are_left_alone(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file.create_group("mine")["notes"] = [1, 2, 3]
    assert Run.load(path).name == made().name
    assert salvage(path).notices == ()


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("events", "{", "events: value error, "),
        ("events", '[{"time": NaN}]', "events: value error, NaN is no number"),
        ("events", "[" * 50_000, "events: value error, nested too deeply"),
        ("events", "[1]", "events: value error, expected a list of mappings"),
        ("events", "[" + "9" * 5000 + "]", "events: value error, Exceeds the limit"),
        ("control_period", -1.0, "control_period: input should be greater than or equal to 0; got "),
        ("control_period", "1 ms", "control_period: input should be a valid number; got '1 ms'"),
        ("has_tank", 7, "has_tank: input should be less than or equal to 1; got "),
        ("name", 3, "name: input should be a valid string; got "),
        ("name", "x" * 2000, "name: string should have at most 1000 characters; got "),
        ("duration", np.inf, "duration: input should be a finite number; got "),
        ("scenario", np.arange(3), "scenario: input should be a valid string; got "),
        ("robot", [1.0, 2.0], "robot: input should be a valid string; got "),
        ("joint_parameters", "[]", "joint_parameters: value error, expected a mapping as JSON"),
    ],
)
def test_an_attribute_that_no_run_has_is_one_line_or_left_out(
    path: Path, name: str, value: Any, said: str
) -> None:
    with h5py.File(path, "a") as file:
        file.attrs[name] = value
    with pytest.raises(RunFileError) as error:
        Run.load(path)
    assert str(error.value).startswith(f"{path} says what no run says; got {said}")
    assert len(str(error.value)) < 400
    assert [notice for notice in salvage(path).notices if name in notice]


def test_of_a_run_in_which_everything_is_wrong_the_rest_is_shown(path: Path) -> None:
    with h5py.File(path, "a") as file:
        for name in KINDS.keys() - {"format"}:
            file.attrs[name] = np.arange(3)
        file["q"].attrs["units"] = np.arange(4)
        file["dq"].attrs["long_name"] = "x" * 1000
    read, notices = salvage(path)
    assert "made_by" in report_text(read, notices=notices)


def test_units_that_are_no_text_are_refused_or_left_out(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file["q"].attrs["units"] = np.arange(4)
        file["dq"].attrs["long_name"] = "x" * 1000
    with pytest.raises(RunFileError, match=r"has signals whose units are no text; got .*\bq\b"):
        Run.load(path)
    read, notices = salvage(path)
    assert any(notice.startswith("Signals whose units are no text: ") for notice in notices)
    assert "units" not in read.data["q"].attrs


ALIASES = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{b}: &{b} [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    "configuration",
    [
        "robot: /dev/zero", 'robot: "/a\\0b.yaml"', "robot: " + "[" * 1500, "robot: 2001-99-99",
        "robot: " + "9" * 5000, ALIASES + "robot: *i", "robot: !!python/name:os.system", "robot: {a: 1}",
        "robot: planar2r\nrobot: planar2r\ntool: 1", "<" * 10_000, "\x07",
    ],
)  # fmt: skip
def test_a_configuration_of_any_kind_is_shown_without_an_arm(configuration: str) -> None:
    data = made().data.copy()
    data.attrs |= {"robot_description": "", "scenario": configuration}
    assert chain_of(Run(data)) is None
    assert "/dev" not in shown_configuration(Run(data))
    assert (marks_of(Run(data)), ideal_motion(Run(data))) == ((), None)


@pytest.mark.parametrize(
    "description",
    [
        "<robot>" + "<!--" * 100_000, "<robot name='a'>" + "<x>" * 20_000, "<!DOCTYPE a [<!ENTITY b 'c'>]><robot/>",
        "<robot name='a'>" + "".join(f"<link name='{i}'/>" for i in range(5000)) + "</robot>", "<\0>", "/dev/zero",
    ],
)  # fmt: skip
def test_a_description_of_any_kind_is_shown_without_an_arm(description: str) -> None:
    data = made().data.copy()
    data.attrs |= {"robot_description": description, "scenario": ""}
    assert chain_of(Run(data)) is None


def own_robot(folder: Path) -> Path:
    """Return a robot file that is no robot of the catalogue by its name."""
    data = Path(str(resources.files("passiflex.robots") / "data"))
    for name in ("planar2r.urdf", "planar2r.yaml"):
        shutil.copy(data / name, folder / name)
    return (folder / "planar2r.yaml").rename(folder / "mine.yaml")


def with_ratio(robot: Path) -> str:
    text = PLANAR.replace("robot: planar2r", f"robot: {robot}")
    return text + "tool: {position: [0.05, 0, 0.02], rotation_vector: [0, 0.3, 0]}\n"


def test_a_robot_file_that_a_run_names_is_not_opened_and_not_needed(tmp_path: Path) -> None:
    robot = own_robot(tmp_path)
    scenario = parse_scenario(with_ratio(robot))
    problem = resolve(scenario)
    run = Run.load(simulate(scenario).save(tmp_path / "run.nc"))
    header, ideal = metrics_header([run], ["a"]), ideal_motion(run)
    robot.write_text("no robot any more")
    found = problem_of(run, scenario)
    assert found is not None
    for name in ("plant", "model", "gains", "q", "theta"):
        np.testing.assert_allclose(getattr(found, name), getattr(problem, name), rtol=1e-9, atol=1e-12)
    assert metrics_header([run], ["a"]) == header
    assert len(header["rows"]) > 10
    np.testing.assert_array_equal(ideal_motion(run), ideal)
    for change in (
        {"joint_parameters": "{}"},
        {"robot_description": ""},
        {"joint_parameters": '{"joint_stiffness": 1}'},
    ):
        assert problem_of(Run(run.data.assign_attrs(change)), scenario) is None


@pytest.mark.parametrize("wrong", ["x", [[1], [1, 2]], None, [1], [-1, 1]])
def test_joints_with_numbers_that_no_robot_has_make_none(wrong: Any) -> None:
    numbers = json.dumps(dict.fromkeys(JOINT_PARAMETERS, wrong))
    run = Run(made().data.assign_attrs(joint_parameters=numbers))
    try:
        assert robot_of(run) is None
    except (SizeError, ValueRangeError) as error:
        assert str(error).startswith("joint_stiffness of robot 'planar2r'; got ")  # noqa: PT017 - one of two ends


def test_what_is_no_file_is_not_opened(tmp_path: Path) -> None:
    (tmp_path / "run.nc").symlink_to("/dev/zero")
    for read in (Run.load, salvage):
        with pytest.raises(RunFileError, match="is no regular file"):
            read(tmp_path / "run.nc")


def test_of_a_large_file_that_is_no_run_only_the_beginning_is_read(tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    with path.open("wb") as file:
        file.truncate(2**40)  # no machine holds it in memory
    with pytest.raises(RunFileError, match="is not a netCDF-4 file"):
        Run.load(path)
