"""A run as ROS 2 messages in an MCAP file, which Foxglove and PlotJuggler open."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from passiflex.exports.ros2_definitions import definition_of
from passiflex.exports.ros2_topics import topics_of
from passiflex.exports.signals import signals_of
from passiflex.extras import imported
from passiflex.robots.solids import with_solids
from passiflex.runs.run import Run
from passiflex.runs.run_arm import chain_of


def write_mcap(run: Run, path: Path) -> None:
    """Write all rows of a run as ROS 2 messages (CDR); time is simulated time, from 0.

    `/tf` has the frames `base`, `link_1`, ..., `tip`, `/robot_description` the arm with clean solids, as in a
    URDF; `/joint_states` q, q̇, τ_a and `/motor_states` θ, θ̇, τ_m by joint; `/end_effector`, `/reference` and
    `/governed_reference` poses in `base`; `/wrench` what the environment exert, at the end effector in the
    axes of the base. A scalar signal is a topic of its own: `/energy/tank`, `/power/external`, `/signal/valve`;
    any other one `/signal/NAME`, with its entries row by row. The units are in the metadata record `units`, by
    topic and field. A run that does not say which arm it was has no `/tf` and no `/robot_description`; a pose that is
    not finite is left out.

    Raises
    ------
    MissingExtraError
        If mcap-ros2-support is not installed.
    """
    library = imported("mcap_ros2.writer", "mcap", "an MCAP file")
    chain, time = chain_of(run), np.rint(run.time * 1e9).astype(np.int64).tolist()
    with path.open("wb") as file, library.Writer(file) as writer:
        writer.add_metadata("run", {key: str(value) for key, value in run.data.attrs.items()})
        topics = list(topics_of(chain, list(signals_of(run)), time))
        units = {t.name: {field: list(unit) for field, unit in t.units.items()} for t in topics}
        writer.add_metadata("units", {t: json.dumps(u, ensure_ascii=False) for t, u in units.items()})
        schemas = {t.kind: writer.register_msgdef(*_definition(t.kind)) for t in topics}
        if chain is not None:
            schema = writer.register_msgdef(*_definition("std_msgs/String"))
            writer.write_message("/robot_description", schema, {"data": with_solids(chain)}, time[0])
        for row, instant in enumerate(time):
            for topic in topics:
                message = topic.message(row)
                if message is not None:
                    writer.write_message(topic.name, schemas[topic.kind], message, instant, instant, row)


def _definition(kind: str) -> tuple[str, str]:
    """Return the full name of a message, as ROS 2 has it, and its definition."""
    return kind.replace("/", "/msg/"), definition_of(kind)
