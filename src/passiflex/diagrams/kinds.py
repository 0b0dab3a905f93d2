"""The kinds of diagrams that there are of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from passiflex.diagrams.contact import contact_panels
from passiflex.diagrams.energy import energy_panels
from passiflex.diagrams.panel import Panel
from passiflex.diagrams.port import port_panels
from passiflex.diagrams.torque import torque_panels
from passiflex.diagrams.tracking import tracking_panels
from passiflex.diagrams.viewed import Viewed
from passiflex.errors import NameUnknownError

VIEWS: dict[str, Callable[[Viewed, Sequence[Viewed]], tuple[Panel, ...]]] = {
    "energy": energy_panels,
    "port": port_panels,
    "tracking": tracking_panels,
    "torque": torque_panels,
    "contact": contact_panels,
}
KINDS = tuple(VIEWS)


def panels(kind: str, viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[Panel, ...]:
    """Return the diagrams of a kind for a run, with other runs beside it where they can be compared.

    A curve whose signals are not in the file is left out, and a diagram without curves; what is not a
    number stays a gap.

    Raises
    ------
    NameUnknownError
        If there is no such kind.
    """
    if kind not in VIEWS:
        raise NameUnknownError("kind of diagram", kind, KINDS)
    return VIEWS[kind](viewed, others)
