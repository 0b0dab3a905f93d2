"""The MCAP file: ROS 2 messages that other readers decode to the numbers of the run."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import SeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from rerun.chunk import McapReader
from scipy.spatial.transform import Rotation

from passiflex.exports import export_run
from passiflex.exports.ros2_definitions import PARTS, definition_of
from passiflex.robots import SerialChain
from passiflex.robots.frames import world_frames
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run

Messages = dict[str, list[tuple[int, Any]]]


def decoded(path: Path) -> Messages:
    """Return times [ns] and messages by topic, as the reader of the MCAP project decodes them."""
    found: Messages = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, ros in reader.iter_decoded_messages():
            found[channel.topic].append((message.log_time, ros))
    return found


@pytest.fixture(scope="module")
def exported(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_run(run, tmp_path_factory.mktemp("mcap") / "run.mcap")


@pytest.fixture(scope="module")
def messages(exported: Path) -> Messages:
    return decoded(exported)


def numbers(v: Any) -> list[float]:
    return [getattr(v, axis) for axis in "xyzw" if hasattr(v, axis)]


def test_joints_are_those_of_the_run(run: Run, messages: Messages) -> None:
    for topic, parts in (
        ("/joint_states", ("q", "dq", "tau_a")),
        ("/motor_states", ("theta", "dtheta", "tau_m")),
    ):
        times, states = zip(*messages[topic], strict=True)
        assert list(times) == [round(t * 1e9) for t in run.time]
        assert all(s.header.stamp.sec * 10**9 + s.header.stamp.nanosec == t for t, s in messages[topic])
        assert states[0].name == ["joint_1", "joint_2"]
        for field, signal in zip(("position", "velocity", "effort"), parts, strict=True):
            np.testing.assert_array_equal([getattr(s, field) for s in states], run[signal])


def test_joints_are_called_as_in_the_robots_own_description(run: Run, tmp_path: Path) -> None:
    data = run.every(100).data.copy()
    described = (
        data.attrs["robot_description"].replace('"joint_1"', '"shoulder"').replace('"joint_2"', '"elbow"')
    )
    data.attrs["robot_description"] = described
    found = decoded(export_run(Run(data), tmp_path / "run.mcap"))
    assert found["/motor_states"][0][1].name == ["shoulder", "elbow"]
    ((_, text),) = found["/robot_description"]
    assert [joint.name for joint in SerialChain.from_urdf(text.data).joints] == ["shoulder", "elbow"]


def test_every_other_signal_has_a_topic_with_its_numbers(run: Run, messages: Messages) -> None:
    elsewhere = {"q", "dq", "tau_a", "theta", "dtheta", "tau_m", "wrench"}
    elsewhere |= {
        f"{which}{what}" for which in ("", "desired_", "governed_") for what in ("position", "rotation")
    }
    seen = set()
    for name, variable in run.data.data_vars.items():
        signal = str(name)
        if variable.dims[:1] != ("time",) or signal in elsewhere:
            continue
        topic = f"/signal/{signal}"
        for quantity in ("energy", "power"):
            if signal.endswith(f"_{quantity}"):
                topic = f"/{quantity}/{signal.removesuffix(f'_{quantity}')}"
        got = np.array([ros.data for _, ros in messages[topic]])
        np.testing.assert_array_equal(got.reshape(run[signal].shape), run[signal])
        seen.add(topic)
    assert {"/energy/tank", "/power/external", "/signal/held_stiffness", "/signal/valve"} <= seen


def test_the_frames_put_the_end_effector_where_the_run_has_it(run: Run, messages: Messages) -> None:
    chain = chain_of(run)
    assert chain is not None
    frames = world_frames(chain, run["q"])
    for row, (_, ros) in enumerate(messages["/tf"]):
        if row % 50:
            continue
        known = {"base": (np.zeros(3), np.eye(3))}
        for transform in ros.transforms:
            p, R = known[transform.header.frame_id]
            turn = Rotation.from_quat(numbers(transform.transform.rotation)).as_matrix()
            known[transform.child_frame_id] = (p + R @ numbers(transform.transform.translation), R @ turn)
        assert list(known) == ["base", "link_1", "link_2", "tip", "contact"]
        for i, name in enumerate(("base", "link_1", "link_2", "tip")):
            np.testing.assert_allclose(known[name][0], frames.position[row, i], atol=1e-12)
            np.testing.assert_allclose(known[name][1], frames.rotation[row, i], atol=1e-12)
        np.testing.assert_allclose(known["tip"][0], run["position"][row], atol=1e-12)
        np.testing.assert_array_equal(known["contact"][0], run["position"][row])
        np.testing.assert_array_equal(known["contact"][1], np.eye(3))


@pytest.mark.parametrize(
    ("topic", "prefix"),
    [("/end_effector", ""), ("/reference", "desired_"), ("/governed_reference", "governed_")],
)
def test_poses_are_those_of_the_run(run: Run, messages: Messages, topic: str, prefix: str) -> None:
    poses = [ros.pose for _, ros in messages[topic]]
    np.testing.assert_array_equal([numbers(p.position) for p in poses], run[f"{prefix}position"])
    turns = Rotation.from_quat([numbers(p.orientation) for p in poses]).as_matrix()
    np.testing.assert_allclose(turns, run[f"{prefix}rotation"], atol=1e-12)
    assert {ros.header.frame_id for _, ros in messages[topic]} == {"base"}


def test_the_wrench_acts_at_the_end_effector_in_the_axes_of_the_base(run: Run, messages: Messages) -> None:
    got = [[*numbers(ros.wrench.force), *numbers(ros.wrench.torque)] for _, ros in messages["/wrench"]]
    np.testing.assert_array_equal(got, run["wrench"])
    assert np.abs(run["wrench"]).max() == 3
    assert {ros.header.frame_id for _, ros in messages["/wrench"]} == {"contact"}


def test_the_description_is_the_arm(run: Run, messages: Messages) -> None:
    ((time, ros),) = messages["/robot_description"]
    chain = chain_of(run)
    assert chain is not None
    assert time == 0
    assert SerialChain.from_urdf(ros.data).to_urdf() == chain.to_urdf()
    assert ros.data.count("<visual>") > 5


def test_the_file_can_be_searched_and_says_what_it_is(run: Run, exported: Path) -> None:
    with exported.open("rb") as file:
        reader = SeekingReader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert reader.get_header().profile == "ros2"
        assert summary.statistics is not None
        assert summary.statistics.message_start_time == 0
        assert summary.statistics.message_end_time == round(run.time[-1] * 1e9)
        assert summary.chunk_indexes
        assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
        records = {record.name: record.metadata for record in reader.iter_metadata()}
    assert records["run"]["name"] == run.name
    units = {topic: json.loads(text) for topic, text in records["units"].items()}
    assert set(units) == {c.topic for c in summary.channels.values()} - {"/robot_description"}
    assert units["/energy/tank"] == {"data": ["J"]}
    assert units["/joint_states"] == {
        "position": ["rad"] * 2,
        "velocity": ["rad/s"] * 2,
        "effort": ["N m"] * 2,
    }
    assert units["/wrench"] == {"force": ["N"], "torque": ["N m"]}


def test_what_a_damaged_run_lacks_is_left_out(damaged: Run, tmp_path: Path) -> None:
    found = decoded(export_run(damaged, tmp_path / "run.mcap"))
    assert not {"/tf", "/robot_description", "/reference", "/energy/external"} & set(found)
    assert len(found["/end_effector"]) == len(damaged.time) - 5
    assert {ros.header.frame_id for _, ros in found["/wrench"]} == {"base"}
    q = np.array([ros.position for _, ros in found["/joint_states"]])
    np.testing.assert_array_equal(q, damaged["q"])
    assert all(ros.velocity == [] for _, ros in found["/motor_states"])


def test_gaps_of_a_run_with_an_arm_leave_out_the_frames_that_are_not_known(run: Run, tmp_path: Path) -> None:
    data = run.data.copy(deep=True)
    data["q"][5, 0] = np.nan
    found = decoded(export_run(Run(data), tmp_path / "run.mcap"))
    assert [t.child_frame_id for t in found["/tf"][5][1].transforms] == ["link_2", "tip", "contact"]
    assert len(found["/tf"][6][1].transforms) == 4


def test_a_reader_of_another_house_finds_the_same_numbers(run: Run, exported: Path) -> None:
    """Rerun decodes the schemas and messages by code of its own, in Rust; it knows frames when it sees them."""
    found = defaultdict(list)
    for chunk in McapReader(str(exported)).stream().to_chunks():
        columns = chunk.to_record_batch().to_pydict()
        for name, values in columns.items():
            found[chunk.entity_path, name] += values
    levels = [message["data"] for (message,) in found["/energy/tank", "std_msgs.msg.Float64:message"]]
    np.testing.assert_array_equal(levels, run["tank_energy"])
    np.testing.assert_array_equal(found["/signal/phi", "Scalars:scalars"], run["phi"])
    children = [child for (child,) in found["/tf", "Transform3D:child_frame"]]
    assert children == ["link_1", "link_2", "tip", "contact"] * len(run.time)


@pytest.mark.parametrize("name", sorted(PARTS))
def test_a_definition_holds_all_that_is_in_it(name: str) -> None:
    """Each type that is not built in is defined once, and none that is not needed."""
    own, *parts = definition_of(name).split("=" * 80)
    defined = {part.split("MSG: ")[1].split()[0] for part in parts}
    used = {
        w.removesuffix("[]") for part in [own, *parts] for w in part.split() if w.removesuffix("[]") in PARTS
    }
    assert used - {name} == defined
    assert len(defined) == len(parts)
