"""The page of a campaign: verdicts, distributions, the responses, and which parameters matter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from passiflex.campaigns.intervals import Share
from passiflex.campaigns.page import Band, Bars, Ecdf, Page, Scatter
from passiflex.metrics.measures import MEASURES
from passiflex.plotting.figures import Series
from passiflex.plotting.style import BLUE, LINES, ROLES, axis_label, figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

A4 = (8.27, 11.69)
"""Portrait [in]."""
VERDICTS: dict[str, dict[str, Any]] = {
    "passive": {"color": ROLES["passive"].light, "marker": "o", "s": 14},
    "violated": {"color": ROLES["violated"].light, "marker": "X", "s": 28},
    "inconclusive": {"color": ROLES["inconclusive"].light, "marker": "s", "s": 18},
}
"""Told apart by colour, also by those who see fewer, and by shape."""
MORE, LESS, DIFFERENT = (ROLES[role].light for role in ("passive", "violated", "neutral"))
"""Colours of the bars: the metric rises with the parameter, falls, differs between words."""


def draw_campaign(page: Page, lines: Mapping[str, Series] | None = None) -> Figure:
    """Return the page, A4 portrait.

    Parameters
    ----------
    lines: Drawn over the responses, by the names of `LINES`: displacement along the step (N,) m.
    """
    import matplotlib.pyplot as plt

    with figure_style():
        figure = plt.figure(figsize=A4)
        figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.08)
        parts = figure.subfigures(4, 1, height_ratios=(2.4, 2.2, 3.9, 3.0))
        top, middle, bars, bottom = parts.tolist()  # type: ignore[union-attr]
        verdicts, responses = top.subplots(1, 2, width_ratios=(1.0, 1.5))
        _shares(verdicts, page.shares)
        _band(responses, page.band, lines or {})
        for axes, ecdf in zip(
            _row(middle, len(page.distributions)), page.distributions or (None,), strict=True
        ):
            _ecdf(axes, ecdf)
        for axes, one in zip(_row(bars, len(page.bars)), page.bars or (None,), strict=True):
            _bars(axes, one, page)
        if page.bars:
            bars.supxlabel(_meaning(page.chance), fontsize=6.5, color="0.25")
        _scatter(bottom.subplots(), page.scatter)
        figure.suptitle(page.title, fontsize=11)
        bottom.supxlabel(page.conditions, fontsize=6, color="0.35")
        return figure


def _row(part: SubFigure, count: int) -> list[Axes]:
    """Return axes beside each other, one where there is nothing to draw."""
    axes: list[Axes] = part.subplots(1, max(count, 1), sharey=True, squeeze=False)[0].tolist()
    return axes


def draw_band(axes: Axes, band: Band) -> None:
    """Draw the median of responses and where half and nine tenths of them are."""
    low, lower, median, upper, high = band.quantiles
    axes.fill_between(band.time, low, high, color=BLUE, alpha=0.15, lw=0, label="5 to 95 %")
    axes.fill_between(band.time, lower, upper, color=BLUE, alpha=0.3, lw=0, label="25 to 75 %")
    axes.plot(band.time, median, color=BLUE, lw=1.3, label="median")


def _shares(axes: Axes, shares: tuple[Share, ...]) -> None:
    for row, share in enumerate(shares):
        color = VERDICTS.get(share.name, {}).get("color", "0.35")
        axes.plot([share.low, share.high], [row, row], color=color, lw=4, alpha=0.35, solid_capstyle="butt")
        axes.plot(share.share, row, marker="o", ms=5, color=color, clip_on=False)
        axes.text(
            1.06, row, f"{share.count} of {share.of}", va="center", fontsize=7,
            transform=axes.get_yaxis_transform(),
        )  # fmt: skip
    axes.set_yticks(range(len(shares)), [share.name.replace("_", " ") for share in shares])
    axes.set_ylim(len(shares) - 0.4, -0.6)
    axes.set_xlim(0, 1)
    axes.set_xticks([0, 0.25, 0.5, 0.75, 1], ["0", "25", "50", "75", "100"])
    axes.set_xlabel(axis_label("of all samples", "%"))
    axes.set_title("shares, and their intervals")


def _band(axes: Axes, band: Band | None, lines: Mapping[str, Series]) -> None:
    axes.set_title("responses")
    if band is None:
        _nothing(axes, "no responses to a step were kept")
        return
    draw_band(axes, band)
    for name, curve in lines.items():
        axes.plot(curve.time, curve.values, **LINES[name] | {"lw": 1.0})
    axes.set_xlabel("time [s]")
    axes.set_ylabel("along the step [m]")
    axes.margins(x=0)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=5, columnspacing=1, handlelength=1.5)


def _ecdf(axes: Axes, ecdf: Ecdf | None) -> None:
    if ecdf is None:
        _nothing(axes, "no metric was kept that is drawn here")
        return
    name = _measured(ecdf.metric)
    if ecdf.values.size:
        axes.step(ecdf.values, ecdf.shares, where="post", color=BLUE, lw=1.3)
    else:
        _nothing(axes, "no finite value")
    axes.set_ylim(0, 1.02)
    axes.set_xlabel(name + (f"\n{100 * ecdf.endless:.3g} % not finite" if ecdf.endless else ""))
    axes.locator_params(axis="x", nbins=4)
    if axes.get_subplotspec().is_first_col():  # type: ignore[union-attr]
        axes.set_ylabel(axis_label("share of samples at or below", "1"))


def _bars(axes: Axes, bars: Bars | None, page: Page) -> None:
    if bars is None:
        _nothing(axes, "nothing to compare: no parameter or no metric varies")
        return
    for row, (strength, signed, significant) in enumerate(
        zip(bars.strengths, bars.signed, bars.significant, strict=True)
    ):
        if not np.isfinite(strength):
            axes.text(0.01, row, "constant", va="center", fontsize=6, color="0.5")
            continue
        color = DIFFERENT if not signed else MORE if strength > 0 else LESS
        face = color if significant else "white"
        axes.barh(row, abs(strength), height=0.65, facecolor=face, edgecolor=color, lw=0.9)
        sign = "" if not signed else "+" if strength > 0 else "−"
        axes.text(abs(strength) + 0.02, row, sign, va="center", fontsize=8, color=color)
    rows = np.arange(len(page.columns))
    axes.plot(bars.first_order, rows, ls="", marker="D", ms=3.5, mfc="white", mec="black", mew=0.8)
    axes.set_yticks(range(len(page.columns)), page.columns, fontsize=7)
    axes.set_ylim(len(page.columns) - 0.4, -0.6)
    axes.set_xlim(0, 1.08)
    axes.set_xlabel(axis_label("strength", "1"))
    axes.grid(visible=False, axis="y")
    axes.set_title(bars.metric.replace("_", " "), fontsize=8)


def _meaning(chance: float) -> str:
    return (
        "bar: |rank correlation|, + rises and − falls with the parameter; grey: difference between words; "
        f"filled: more than chance (p ≤ {chance:.3g} after Holm); diamond: √(share of the variance)"
    )


def _scatter(axes: Axes, scatter: Scatter | None) -> None:
    if scatter is None:
        _nothing(axes, "nothing that varies to draw")
        return
    for verdict, style in VERDICTS.items():
        chosen = scatter.verdicts == verdict
        if chosen.any():
            axes.scatter(
                scatter.x[chosen], scatter.y[chosen], label=verdict, linewidths=0.3, edgecolors="white",
                alpha=0.8, **style,
            )  # fmt: skip
    if scatter.words:
        axes.set_xticks(range(len(scatter.words)), scatter.words)
        axes.set_xlim(-0.6, len(scatter.words) - 0.4)
    if scatter.logarithmic:
        axes.set_xscale("log")
    axes.set_xlabel(_with_unit(scatter))
    axes.set_ylabel(_measured(scatter.metric))
    axes.set_title("the most important parameter")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handletextpad=0.1)


def _measured(metric: str) -> str:
    return axis_label(metric.replace("_", " "), MEASURES[metric].unit)


def _with_unit(scatter: Scatter) -> str:
    """Return the parameter with its unit; words have none."""
    pure = not scatter.words and not scatter.parameter.endswith("]")
    return axis_label(scatter.parameter, "1") if pure else scatter.parameter


def _nothing(axes: Axes, why: str) -> None:
    axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes, color="0.4")
    axes.set_xticks([])
    axes.set_yticks([])
