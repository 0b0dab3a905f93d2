"""What flows through the ports of a run: powers, and energies since the start, each with its sign in its name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from passiflex.diagrams.events import marks_of, spans_of
from passiflex.diagrams.panel import Curve, Panel
from passiflex.diagrams.viewed import Viewed, curve, curves, with_curves
from passiflex.runs.run import Run


class Flow(NamedTuple):
    """A port: what is positive, and its role."""

    label: str
    role: str


PHYSICAL: Mapping[str, Flow] = {
    "external": Flow("environment, into the robot", "environment"),
    "motor": Flow("motor torque, into the motors", "motor"),
    "joint": Flow("joints, into the links", "joint"),
    "joint_loss": Flow("joint dampers, lost", "loss"),
    "friction": Flow("motor friction, lost", "friction"),
}
"""Of the real robot, whatever its law. A signal is the name with `_power` or `_energy`."""
BOOKED: Mapping[str, Flow] = {
    "reference": Flow("reference, into the spring", "moving reference"),
    "granted": Flow("paid for the reference", "granted"),
    "drawn": Flow("drawn from the tank", "drawn"),
    "refilled": Flow("given to the tank", "refilled"),
    "spilled": Flow("past the tank, lost", "spilled"),
}
"""Of the law's own books; a law in continuous time draws what it pays, and does not sum up what it fills in."""
WITHOUT_TANK: Mapping[str, Flow] = {
    "reference": BOOKED["reference"],
    "spilled": Flow("dampers of the law, lost", "spilled"),
}


def port_panels(viewed: Viewed, others: Sequence[Viewed] = ()) -> tuple[Panel, ...]:
    """Return powers and energies of the real ports, and those of the law's books; compared runs have no part.

    A diagram in which nothing ever flows is left out.
    """
    run = viewed.run
    spans, marks = spans_of(run), marks_of(run)
    booked = BOOKED if run.data.attrs.get("has_tank") else WITHOUT_TANK
    made = (
        ("powers", "power", "W", PHYSICAL, "power"),
        ("powers of the law", "power, by the law", "W", booked, "power"),
        ("energies", "energy since the start", "J", PHYSICAL, "energy"),
        ("energies of the law", "energy, by the law", "J", booked, "energy"),
    )
    found = with_curves(
        *(
            Panel("port", choice, title, unit, _flows(run, flows, suffix), (), spans, marks)
            for choice, title, unit, flows, suffix in made
        )
    )
    return tuple(panel for panel in found if any(c.values.any() for c in panel.curves))


def _flows(run: Run, flows: Mapping[str, Flow], suffix: str) -> tuple[Curve, ...]:
    return curves(*(_flow(run, f"{name}_{suffix}", flow) for name, flow in flows.items()))


def _flow(run: Run, signal: str, flow: Flow) -> Curve | None:
    return curve(run, flow.label, flow.role, lambda: run[signal])
