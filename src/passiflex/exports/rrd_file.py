"""A run as a Rerun recording: the moving arm beside its diagrams."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from passiflex.diagrams import KINDS, Panel, Viewed, ideal_motion, marks_of, panels, spans_of
from passiflex.exports.rerun_scene import log_scene
from passiflex.exports.rerun_stream import GREY, PALETTE, TIMELINE, Stream
from passiflex.exports.signals import signals_of
from passiflex.extras import imported
from passiflex.passivity import audit_if_possible
from passiflex.runs.run import Run

OPENED = {"energy": "energies", "port": "powers", "tracking": "z", "torque": "all joints", "contact": "force"}
"""Kind of diagram → the choice of it that a viewer opens; the first one where a run has no such choice."""
PROPERTIES = ("name", "robot", "law", "seed", "control_period", "duration", "version", "commit", "failure")


def write_rrd(run: Run, path: Path) -> None:
    """Write all rows of a run as a Rerun recording on the timeline `time`, which is simulated time.

    Below `world/` are the arm as clean solids that move by q, the end effector and its path, the reference,
    the ideal mass-spring-damper, and the external force as an arrow; below `diagrams/KIND/CHOICE/` the curves
    and levels of a report, in `events` what happened, below `signals/` each signal of the file. Curves and
    signals are float64 and bit for bit those of the run; what moves in `world/` is float32, as Rerun has it.
    No row is left out. A blueprint opens the arm beside the diagrams. The recording's properties say what was
    run, and the audit's verdict.

    Raises
    ------
    MissingExtraError
        If rerun-sdk is not installed.
    """
    rr = imported("rerun", "rerun", "a Rerun recording")
    ideal = ideal_motion(run)
    diagrams = [panel for kind in KINDS for panel in panels(kind, Viewed(run, run.name, ideal))]
    with rr.RecordingStream("passiflex", recording_id=uuid4()) as recording:
        stream = Stream(rr, recording)
        recording.save(path, default_blueprint=_blueprint(stream, diagrams))
        recording.send_recording_name(run.name)
        recording.send_property("run", rr.AnyValues(**_properties(run)))
        configuration = str(run.data.attrs.get("scenario", ""))
        stream.constant(["configuration"], rr.TextDocument(configuration))
        log_scene(stream, run, ideal)
        for panel in diagrams:
            _log_panel(stream, panel)
        for signal in signals_of(run):
            stream.series(["signals", signal.name], signal.titles, run.time, signal.values)
        _log_events(stream, run)
        recording.flush()
        recording.disconnect()


def _properties(run: Run) -> dict[str, str]:
    """Return what was run, and how it ended."""
    found = {name: str(run.data.attrs.get(name, "")) for name in PROPERTIES}
    verdict = audit_if_possible(run)
    if verdict is None:
        found["verdict"] = "none: signals of the energy balances are missing or have gaps"
    else:
        found |= {"verdict": verdict.verdict, "margin": f"{verdict.margin:.6g} J", "remedy": verdict.remedy}
    return {name: value for name, value in found.items() if value}


def _place(panel: Panel) -> tuple[str, str, str]:
    return ("diagrams", panel.kind, panel.choice)


def _log_panel(stream: Stream, panel: Panel) -> None:
    """Log the curves of a diagram, and its levels as curves from the first instant to the last."""
    for k, curve in enumerate(panel.curves):
        place, name = (*_place(panel), curve.label), f"{curve.label} [{panel.unit}]"
        colour = PALETTE[k % len(PALETTE)]
        stream.series(place, [name], curve.time, curve.values[:, None], [colour])
    ends = np.array([panel.curves[0].time[0], panel.curves[0].time[-1]])
    for level in panel.levels:
        name = f"{level.label} {level.value:g}"  # both limits of a torque have the same label
        place = (*_place(panel), name)
        stream.series(place, [f"{name} [{panel.unit}]"], ends, np.full((2, 1), level.value), [GREY])


def _log_events(stream: Stream, run: Run) -> None:
    """Log what happened, at the instants at which it happened or began."""
    told = [(mark.time, mark.label) for mark in marks_of(run)]
    told += [(span.start, f"{span.kind}: {span.label}, until {span.end:g} s") for span in spans_of(run)]
    if told:
        time, text = zip(*sorted(told), strict=True)
        levels = ["INFO"] * len(text)
        stream.columns(["events"], time, stream.rr.TextLog.columns(text=list(text), level=levels))


def _blueprint(stream: Stream, diagrams: Sequence[Panel]) -> Any:
    """Return the layout: the arm on the left, one diagram of each kind on the right, the others behind it."""
    rrb = imported("rerun.blueprint", "rerun", "a Rerun recording")
    slots = []
    for kind in KINDS:
        some = [panel for panel in diagrams if panel.kind == kind]
        if some:
            views = [
                rrb.TimeSeriesView(origin=stream.path(*_place(p)), name=f"{p.choice}: {p.title} [{p.unit}]")
                for p in some
            ]
            opened = [k for k, panel in enumerate(some) if panel.choice == OPENED[kind]]
            slots.append(rrb.Tabs(*views, active_tab=opened[0] if opened else 0, name=kind))
    arm = rrb.Spatial3DView(origin="world", name="arm")
    events = rrb.TextLogView(origin="events", name="events")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(arm, events, row_shares=[5, 1]), rrb.Vertical(*slots), column_shares=[1, 1]
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        collapse_panels=True,
    )
