"""Every axis of every figure of the package says its unit, in its own label or in that of the axis it shares."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagrams.seen import EVERYWHERE, held_back, made_up, touching
from passiflex.campaigns.page import Scatter
from passiflex.diagrams import Viewed
from passiflex.plotting.campaign import draw_campaign
from passiflex.plotting.figures import CircleColumn, Series, StepColumn, draw_circle, draw_steps
from passiflex.plotting.limits import draw_limits
from passiflex.plotting.run import draw_run
from passiflex.plotting.sampled import draw_sampled
from passiflex.plotting.sensitivity import CIRCLE_ROWS, LAWS, STEP_ROWS, Sweep, draw_sensitivity
from passiflex.plotting.uncertainty import draw_uncertainty
from plotting.test_campaign_figure import EMPTY, made
from plotting.test_limits_figure import found, rigid
from plotting.test_sampled_figure import panel
from plotting.test_uncertainty_figure import column

TIME = np.linspace(0, 1, 5)
THREE = np.ones((5, 3)) * TIME[:, None]


def circle() -> Figure:
    energies = dict.fromkeys(("total", "robot", "tank"), TIME)
    return draw_circle([CircleColumn(name, TIME, THREE, THREE, energies, THREE) for name in "ab"], "")


def steps() -> Figure:
    return draw_steps([StepColumn(name, {"proposed": Series(TIME, THREE)}) for name in "ab"], "")


def sensitivity() -> Figure:
    step = {f"{law} {quantity}": [0.1, np.inf] for law in LAWS for quantity, _ in STEP_ROWS}
    round_ = {quantity: [1.0, 2.0] for quantity, _ in CIRCLE_ROWS}
    sweeps = [Sweep("K [N m/rad]", ["1e4", "2e4"], step), Sweep("posture", ["a", "b"], step)]
    return draw_sensitivity(sweeps, [Sweep("circle", ["0.1 m\n4 s", "0.2 m\n4 s"], round_)])


def ratio() -> Figure:
    """Return the page of a campaign whose most important parameter is a pure number."""
    verdicts = np.array(["passive", "violated"])
    return draw_campaign(made(scatter=Scatter("shaped inertia", (), TIME[:2], "margin", TIME[:2], verdicts)))


def words() -> Figure:
    verdicts = np.array(["passive", "violated"])
    scatter = Scatter("inner loop", ("plain", "matched"), TIME[:2], "margin", TIME[:2], verdicts)
    return draw_campaign(made(scatter=scatter))


FIGURES: dict[str, Callable[[], Figure]] = {
    "steps": steps,
    "circle": circle,
    "sensitivity": sensitivity,
    "limits": lambda: draw_limits(found()),
    "limits of the rigid law": lambda: draw_limits(rigid()),
    "sampled": lambda: draw_sampled([[panel(0), panel(1)], [panel(2)]], ""),
    "campaign": lambda: draw_campaign(made()),
    "campaign, a ratio": ratio,
    "campaign, words": words,
    "campaign, empty": lambda: draw_campaign(made(**EMPTY)),
    "uncertainty": lambda: draw_uncertainty(
        [column("a", falls_back=True), column("b", falls_back=False)], ""
    ),
    "contact": lambda: draw_run("contact", Viewed(touching(), "it")),
    **{f"{kind}": lambda kind=kind: draw_run(kind, Viewed(held_back(), "it")) for kind in EVERYWHERE},  # type: ignore[misc]
    **{
        f"{kind} on a slide": lambda kind=kind: draw_run(kind, Viewed(made_up(), "it"), (), "slide")  # type: ignore[misc]
        for kind in EVERYWHERE
    },
}


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


def numeric(labels: list[str]) -> bool:
    """Return whether the ticks of an axis are numbers, and not words or quantities with their own units."""
    return any(re.fullmatch(r"[+−-]?[0-9.,]+(e[+-]?[0-9]+)?|\$.*\$", label) for label in labels if label)


def named(axes: Axes, which: str) -> bool:
    """Return whether the axis says its unit: by its label, or as words; by the axis that it shares or stands beside."""
    axis = getattr(axes, f"{which}axis")
    label = axis.get_label_text()
    if label and re.search(r"\[[^\[\]]+\]", label):
        return True
    ticks = [t.get_text() for t in axis.get_ticklabels() if t.get_visible()]
    return not numeric(ticks) or (not label and "[" in axes.get_title())


def siblings(axes: Axes, which: str, others: list[Axes]) -> list[Axes]:
    """Return the axes that share the scale, and those in the same row (for y) or column (for x) of the grid."""
    shared = getattr(axes, f"get_shared_{which}_axes")().get_siblings(axes)
    spot = axes.get_subplotspec()
    beside = [
        other
        for other in others
        if spot is not None
        and (there := other.get_subplotspec()) is not None
        and there.get_gridspec() is spot.get_gridspec()
        and (there.rowspan == spot.rowspan if which == "y" else there.colspan == spot.colspan)
    ]
    return [*shared, *beside]


@pytest.mark.parametrize("name", FIGURES)
def test_every_axis_says_its_unit(name: str) -> None:
    figure = FIGURES[name]()
    figure.canvas.draw()
    all_axes = [axes for axes in figure.findobj(Axes) if axes.axison]
    assert all_axes
    for axes in all_axes:
        for which in "xy":
            label = getattr(axes, f"{which}axis").get_label_text()
            known = [axes] if label else [axes, *siblings(axes, which, all_axes)]
            assert any(named(one, which) for one in known), (
                f"{name}: {which} {label!r} of {axes.get_title()!r}"
            )
