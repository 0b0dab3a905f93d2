"""What a page says of a run, complete: the header, and the numbers that it points to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from passiflex.diagrams import KINDS, Viewed, marks_of, panels, roles_of, spans_of, viewed
from passiflex.passivity import audit_if_possible
from passiflex.plotting.style import ROLES, Role
from passiflex.reports.arm import arm_header
from passiflex.reports.arrays import Arrays
from passiflex.reports.diagrams import Diagrams, marks_header, spans_header
from passiflex.reports.facts import facts, made_by, shown_configuration
from passiflex.reports.frames import frames_header, ghosts_header
from passiflex.reports.metrics import metrics_header, verdict_header
from passiflex.reports.surfaces import surface_notices, surfaces_header
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run

FORMAT = "passiflex report 1"
NO_ARM = "The arm is not drawn: the file does not say its kinematics."
ANOTHER = "it is another arm, or its file does not say its kinematics"
NO_VERDICT = "There is no verdict: signals of the energy balances are missing or have gaps."


class Content(NamedTuple):
    """The header of a page, and its arrays as text."""

    header: dict[str, Any]
    data: str


def content(run: Run, others: Sequence[Run | Viewed] = (), notices: Sequence[str] = ()) -> Content:
    """Return what a page says of a run beside others."""
    main, *compared = labelled(run, others)
    arrays, said = Arrays(), list(notices)
    runs = [run, *(v.run for v in compared)]
    chain, audits = chain_of(run), [audit_if_possible(each) for each in runs]
    result = audits[0]
    said += [NO_ARM] if chain is None else []
    said += [NO_VERDICT] if result is None else []
    ghosts = ghosts_header(main, compared, roles_of(main, compared)[1:], chain, arrays)
    said += [f"{g['label']} is shown without its arm: {ANOTHER}." for g in ghosts if _is_armless(g)]
    surfaces = surfaces_header(run, arrays)
    said += surface_notices(surfaces, run)
    found = [panel for kind in KINDS for panel in panels(kind, main, compared)]
    verdict = None if result is None else verdict_header(run, result)
    moments = [verdict[key] for key in ("time", "worst_time")] if verdict else []
    diagrams = Diagrams(run.time, arrays, [moment for moment in moments if moment is not None])
    header = {
        "format": FORMAT,
        "title": run.name,
        "made_by": made_by(run),
        "notices": said,
        "facts": facts(run, run.scenario),
        "verdict": verdict,
        "metrics": metrics_header(runs, [main.label, *(v.label for v in compared)], audits),
        "configuration": shown_configuration(run),
        "marks": marks_header(marks_of(run)),
        "spans": spans_header(spans_of(run)),
        "duration": float(run.time[-1]),
        "arm": None if chain is None else arm_header(chain),
        "frames": frames_header(run, run.data.sizes.get("joint", 0), arrays),
        "ghosts": ghosts,
        "surfaces": surfaces,
        "panels": [diagrams.header(panel) for panel in found],
        "times": diagrams.times,
        "styles": {role: _style(look) for role, look in ROLES.items()},
        "thinning": diagrams.thinning,
    }
    return Content(header, arrays.text())


def labelled(run: Run, others: Sequence[Run | Viewed]) -> list[Viewed]:
    """Return all runs with labels: a compared run keeps the one that it was given."""
    named = iter(viewed([run, *(other for other in others if isinstance(other, Run))]))
    return [next(named), *(next(named) if isinstance(other, Run) else other for other in others)]


def _is_armless(ghost: dict[str, Any]) -> bool:
    return ghost["kind"] == "run" and ghost["q"] is None


def _style(role: Role) -> dict[str, Any]:
    return {"light": role.light, "dark": role.dark, "width": role.width, "dash": list(role.dash)}
