"""The Rerun recording: read back by Rerun's own reader, it holds the numbers of the run and an arm that moves."""

from __future__ import annotations

import warnings
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader
from rerun.error_utils import RerunWarning
from scipy.spatial.transform import Rotation

from passiflex.diagrams import KINDS, Viewed, ideal_motion, panels
from passiflex.exports import export_run
from passiflex.exports.signals import signals_of
from passiflex.passivity import audit
from passiflex.robots.frames import world_frames
from passiflex.robots.solids import solids, with_solids
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run

Columns = dict[str, dict[str, Any]]
SINGLE = 2.0**-23
"""Round-off of the numbers that Rerun draws."""


def written(run: Run, path: Path) -> Path:
    """Export without any complaint of Rerun, which warns where others raise."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RerunWarning)
        return export_run(run, path)


def columns_of(path: Path) -> Columns:
    """Return the components by entity: `time` [ns] and lists of values, those without time as one list."""
    found: Columns = defaultdict(dict)
    for chunk in RrdReader(str(path)).stream().to_chunks():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if not name.startswith("rerun.controls"):
                values = column.cast(pa.int64()) if pa.types.is_duration(column.type) else column
                found[chunk.entity_path][name] = values.to_pylist()
    return found


@pytest.fixture(scope="module")
def path(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(run, tmp_path_factory.mktemp("rrd") / "run.rrd")


@pytest.fixture(scope="module")
def columns(path: Path) -> Columns:
    return columns_of(path)


def test_every_signal_is_there_bit_for_bit(run: Run, columns: Columns) -> None:
    for signal in signals_of(run):
        entity = columns[f"/signals/{signal.name}"]
        assert entity["time"] == [round(t * 1e9) for t in run.time]
        assert np.array(entity["Scalars:scalars"]).tobytes() == signal.values.tobytes()
        assert entity["SeriesLines:names"] == [signal.titles]
        assert len(entity["SeriesLines:colors"][0]) == len(signal.titles)
    assert sum(name.startswith("/signals/") for name in columns) == len(list(signals_of(run)))


def test_every_curve_and_level_of_the_views_is_there(run: Run, columns: Columns) -> None:
    import rerun as rr

    viewed = Viewed(run, run.name, ideal_motion(run))
    found = levels = 0
    for panel in (panel for kind in KINDS for panel in panels(kind, viewed)):
        for curve in panel.curves:
            place = rr.new_entity_path(["diagrams", panel.kind, panel.choice, curve.label])
            entity = columns[place]
            np.testing.assert_array_equal(np.ravel(entity["Scalars:scalars"]), curve.values)
            assert entity["SeriesLines:names"] == [[f"{curve.label} [{panel.unit}]"]]
            found += 1
        for level in panel.levels:
            entity = columns[
                rr.new_entity_path(["diagrams", panel.kind, panel.choice, f"{level.label} {level.value:g}"])
            ]
            assert entity["Scalars:scalars"] == [[level.value]] * 2
            assert entity["time"] == [0, round(run.time[-1] * 1e9)]
            levels += 1
    assert found > 10
    assert levels > 2
    assert sum(name.startswith("/diagrams/") for name in columns) == found + levels


def test_the_arm_moves_as_its_kinematics_say(run: Run, columns: Columns) -> None:
    chain = chain_of(run)
    assert chain is not None
    frames = world_frames(chain, run["q"])
    p, R = np.zeros((len(run.time), 3)), np.tile(np.eye(3), (len(run.time), 1, 1))
    place = "/world/base"
    for i, name in enumerate(["link_1", "link_2", "tip"], start=1):
        place = f"{place}/{name}"
        entity = columns[place]
        assert entity["time"] == [round(t * 1e9) for t in run.time]
        step = np.array(entity["Transform3D:translation"])[:, 0]
        turn = Rotation.from_quat(np.array(entity["Transform3D:quaternion"])[:, 0]).as_matrix()
        p, R = p + np.einsum("nij,nj->ni", R, step), R @ turn
        np.testing.assert_allclose(p, frames.position[:, i], atol=10 * SINGLE)
        np.testing.assert_allclose(R, frames.rotation[:, i], atol=10 * SINGLE)
    np.testing.assert_allclose(p, run["position"], atol=10 * SINGLE)
    assert np.ptp(p, axis=0).max() > 0.01


def test_the_solids_are_those_of_the_arm(run: Run, columns: Columns) -> None:
    """Ends and radii, from Rerun's own shapes: a capsule starts at its place, a cylinder has it in the middle."""
    chain = chain_of(run)
    assert chain is not None
    for place, body in zip(("base", "base/link_1", "base/link_1/link_2"), solids(chain), strict=True):
        for kind, shape, where in (
            ("capsule", "Capsules3D", "translations"),
            ("cylinder", "Cylinders3D", "centers"),
        ):
            wanted = [s for s in body if s.kind == kind]
            entity = columns.get(f"/world/{place}/{kind}s", {})
            assert bool(wanted) == bool(entity)
            for k, solid in enumerate(wanted):
                length, radius, turn, at = (
                    entity[f"{shape}:{field}"][0][k] for field in ("lengths", "radii", "quaternions", where)
                )
                along = Rotation.from_quat(turn).as_matrix()[:, 2] * length
                start = np.array(at) - (along / 2 if kind == "cylinder" else 0)
                np.testing.assert_allclose(start, solid.start, atol=10 * SINGLE)
                np.testing.assert_allclose(start + along, solid.end, atol=10 * SINGLE)
                assert radius == pytest.approx(solid.radius, rel=1e-6)


def test_the_arrow_is_the_force_and_ends_at_the_end_effector(run: Run, columns: Columns) -> None:
    entity = columns["/world/external_force"]
    vectors, origins = (np.array(entity[f"Arrows3D:{part}"])[:, 0] for part in ("vectors", "origins"))
    (scale,) = next(value for name, value in entity.items() if name.endswith("metres_per_newton"))[0]
    assert scale == pytest.approx(0.25 / 3)
    np.testing.assert_allclose(vectors, scale * run["wrench"][:, :3], atol=SINGLE)
    np.testing.assert_allclose(origins + vectors, run["position"], atol=10 * SINGLE)


def test_points_are_where_the_run_has_them(run: Run, columns: Columns) -> None:
    ideal = ideal_motion(run)
    wanted = {
        "end_effector": run["position"],
        "reference": run["desired_position"],
        "reference_in_force": run["governed_position"],
    }
    if ideal is not None:
        wanted["ideal"] = run["position"][0] + ideal
    for name, position in wanted.items():
        got = np.array(columns[f"/world/{name}"]["Points3D:positions"])[:, 0]
        np.testing.assert_allclose(got, position, atol=10 * SINGLE)
    ((strip,),) = columns["/world/end_effector/path"]["LineStrips3D:strips"]
    np.testing.assert_allclose(strip, run["position"], atol=10 * SINGLE)


def test_the_recording_says_what_was_run(run: Run, path: Path, columns: Columns) -> None:
    reader = RrdReader(str(path))
    assert [store.application_id for store in (*reader.recordings(), *reader.blueprints())] == [
        "passiflex"
    ] * 2
    properties = {k.split(":")[-1]: v for k, v in columns["/__properties/run"].items()}
    assert properties["name"] == [[run.name]]
    assert properties["robot"] == [["planar2r"]]
    assert properties["verdict"] == [[audit(run).verdict]]
    (text,) = columns["/configuration"]["TextDocument:text"][0]
    assert text == run.data.attrs["scenario"]
    ((urdf,),) = columns["/robot_description"]["TextDocument:text"]
    assert urdf == with_solids(chain_of(run) or pytest.fail("no arm"))
    told = [text for (text,) in columns["/events"]["TextLog:text"]]
    assert any(text.startswith("step 0.05 m") for text in told)
    assert any("force" in text and "until 0.25 s" in text for text in told)


def test_the_blueprint_opens_one_diagram_of_each_kind_and_holds_the_others(run: Run, path: Path) -> None:
    import rerun as rr

    reader = RrdReader(str(path))
    origins, opened = {}, []
    for chunk in reader.stream(store=reader.blueprints()[0]).to_chunks():
        entity = chunk.to_record_batch().to_pydict()
        if "ViewBlueprint:space_origin" in entity:
            ((origins[chunk.entity_path.removeprefix("/")],),) = entity["ViewBlueprint:space_origin"]
        if "ContainerBlueprint:active_tab" in entity:
            opened += [tab for (tab,) in entity["ContainerBlueprint:active_tab"]]
    assert {origins[tab] for tab in opened} == {
        rr.new_entity_path(["diagrams", *place])
        for place in (("energy", "energies"), ("port", "powers"), ("tracking", "z"), ("torque", "all joints"))
    }
    wanted = [p for kind in KINDS for p in panels(kind, Viewed(run, run.name))]
    assert sorted(origins.values()) == sorted(
        ["world", "events", *(rr.new_entity_path(["diagrams", p.kind, p.choice]) for p in wanted)]
    )


def test_two_exports_are_two_recordings(run: Run, path: Path, tmp_path: Path) -> None:
    other = written(run.every(100), tmp_path / "other.rrd")
    ids = {RrdReader(str(p)).recordings()[0].recording_id for p in (path, other)}
    assert len(ids) == 2


def test_what_a_damaged_run_lacks_is_left_out(damaged: Run, tmp_path: Path) -> None:
    columns = columns_of(written(damaged, tmp_path / "run.rrd"))
    assert not any(name.startswith("/world/base") or name == "/robot_description" for name in columns)
    assert len(columns["/world/end_effector"]["time"]) == len(damaged.time) - 5
    assert len(columns["/world/end_effector/path"]["LineStrips3D:strips"][0]) == 2  # before and after the gap
    assert np.isnan(np.array(columns["/signals/q"]["Scalars:scalars"])[10:13, 1]).all()
    properties = {k.split(":")[-1]: v for k, v in columns["/__properties/run"].items()}
    assert properties["verdict"][0][0].startswith("none: ")


def test_a_gap_of_one_joint_stops_what_hangs_on_it(run: Run, tmp_path: Path) -> None:
    data = run.data.copy(deep=True)
    data["q"][5:8, 0] = np.nan
    columns = columns_of(written(Run(data), tmp_path / "run.rrd"))
    assert len(columns["/world/base/link_1"]["time"]) == len(run.time) - 3
    assert len(columns["/world/base/link_1/link_2"]["time"]) == len(run.time)


def test_a_run_without_positions_has_its_signals(run: Run, tmp_path: Path) -> None:
    columns = columns_of(written(Run(run.data.drop_vars("position")), tmp_path / "run.rrd"))
    assert "/world/end_effector" not in columns
    assert "/signals/q" in columns
