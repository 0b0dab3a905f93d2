"""What the package makes for the pages: figures and reports, in groups that share their simulations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from passiflex.robots.robot_entries import Commanded
    from passiflex.simulation import Run

LARGEST = 3_000_000
"""A report that is sent to a colleague has no more bytes than this."""


class Group(NamedTuple):
    """What is made together.

    Attributes
    ----------
    names: Of the files: PNG for a page, HTML for the site's folder of reports.
    make: Writes them, and perhaps others, into a folder.
    """

    names: tuple[str, ...]
    make: Callable[[Path], None]


def paper(folder: Path) -> None:
    """Make the paper's figures with their reports, and pictures of the same runs."""
    from passiflex.simulation import Run
    from passiflex.studies.reproduce import reproduce

    reproduce((), folder)
    runs = {path.stem: Run.load(path) for path in folder.glob("fig?_*.nc")}
    picture(folder / "fig1_tracking.png", runs["fig1_proposed"], runs["fig1_baseline"])
    picture(folder / "fig2_energy.png", runs["fig2_proposed"])
    picture(folder / "fig3_port.png", runs["fig3_proposed"])


def sampled(folder: Path) -> None:
    """Make the figure and reports of the study `sampled`, and a report of the arm that trembles."""
    from passiflex.reports import write_report
    from passiflex.simulation import Run, simulate
    from passiflex.studies.paper import shipped_scenario
    from passiflex.studies.sampled import VARIANTS, reproduce_sampled

    reproduce_sampled(folder)
    tried = VARIANTS["paper_limited"].change(shipped_scenario("fig1_sampled"))
    still = {
        "name": "trembling",
        "description": "the paper's gains and tank at 1 kHz, within the torque limits; nobody asks for anything",
        "reference": (),
        "forces": (),
        "duration": 2.0,  # so short that the report has a pose for each period
    }
    trembling = simulate(tried.model_copy(update=still))
    write_report(trembling, folder / "trembling.html")
    picture(folder / "trembling_torque.png", trembling, until=0.1)
    picture(folder / "fig1_sampled_tracking.png", Run.load(folder / "fig1_sampled_recommended.nc"))
    picture(folder / "fig2_sampled_energy.png", Run.load(folder / "fig2_sampled_recommended_drag.nc"))


def limits(folder: Path) -> None:
    """Make the limit map of `fig1_sampled` with the continuous law at the samples and B_e = 0.3 B."""
    from passiflex.limits import limit_map
    from passiflex.plotting.files import save_figure
    from passiflex.plotting.limits import draw_limits
    from passiflex.scenarios.gain_settings import ShapedInertia
    from passiflex.simulation import resolve
    from passiflex.studies import shipped_scenario

    scenario = shipped_scenario("fig1_sampled")
    control = scenario.control.model_copy(update={"inner_loop": "plain"})
    law = scenario.law.model_copy(update={"shaped_inertia": ShapedInertia(ratio=0.3)})
    found = limit_map(resolve(scenario.model_copy(update={"control": control, "law": law})))
    save_figure(draw_limits(found), folder / "limits")


def contact(folder: Path) -> None:
    """Make the figure and report of the study `contact`, in our own engine alone."""
    from passiflex.studies.contact import ENGINES, reproduce_contact

    reproduce_contact(folder, engines=ENGINES[:1])


def study(name: str) -> Group:
    """Return the group of a study that leaves one figure, one report and one table, all under its name."""

    def make(folder: Path) -> None:
        from passiflex.studies.reproduce import STUDIES

        STUDIES[name](folder, lambda text: None)

    return Group((f"{name}.png", f"{name}.html", f"{name}.md"), make)


def uncertainty(folder: Path) -> None:
    """Make the figure of the study `uncertainty`, of fewer robots than the study has."""
    from passiflex.studies.uncertainty import reproduce_uncertainty

    reproduce_uncertainty(folder, samples=64)


def cards(folder: Path) -> None:
    """Make the card of each arm, side by side on all cores, and the table that links to them."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        made = [pool.submit(one_card, name, by, folder) for name, by in commanded()]
        rows = [row.result() for row in made]
    columns = (
        "arm",
        "commanded by",
        "largest $K_x$, joints as they are",
        "whatever is assumed",
        "lowest rate for 1000 N/m",
    )
    lines = [columns, ("---",) * len(columns), *rows]
    (folder / "cards.md").write_text(
        "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n", encoding="utf-8"
    )


def commanded() -> Iterator[tuple[str, Commanded]]:
    """Yield the robots of the catalogue that something commands, and what does."""
    from passiflex.robots.catalogue import catalogue, read_description

    for name in catalogue():
        if (by := read_description(name).commanded) is not None:
            yield name, by


def one_card(name: str, by: Commanded, folder: Path) -> tuple[str, ...]:
    """Make the card of an arm, one period late, and return its row of the table."""
    import passiflex as pf
    from passiflex.cards.sheet import summary
    from passiflex.reports.card_page import write_card
    from passiflex.stability.clock_words import hertz

    card = pf.card(name, by.rate)
    write_card(card, folder / f"card_{name}.html")
    return f"{{report}}`{name} <card_{name}>`", f"{by.by}, {hertz(by.rate)}", *summary(card)


def picture(target: Path, run: Run, baseline: Run | None = None, until: float | None = None) -> None:
    """Draw a run for the gallery; the name of the file ends in the kind of the diagrams.

    Parameters
    ----------
    baseline: The rigid baseline to draw beside it.
    until: The end of the picture [s]; that of the run if None.
    """
    from passiflex.diagrams import Viewed, ideal_motion
    from passiflex.plotting.files import save_as
    from passiflex.plotting.run import draw_run
    from passiflex.simulation import Run

    shown = Run(run.data.sel(time=slice(0.0, until)))
    others = [] if baseline is None else [Viewed(baseline, "rigid baseline")]
    kind = target.stem.rpartition("_")[2]
    save_as(draw_run(kind, Viewed(shown, "proposed", ideal_motion(shown)), others, "slide"), target)


GROUPS = (
    Group(
        (
            *("fig1.png", "fig2.png", "fig3.png", "fig1.html", "fig2.html", "fig3.html"),
            *("fig1_tracking.png", "fig2_energy.png", "fig3_port.png"),
        ),
        paper,
    ),
    Group(
        (
            *("sampled.png", "fig1_sampled.html", "fig2_sampled.html", "trembling.html"),
            *("fig1_sampled_tracking.png", "fig2_sampled_energy.png", "trembling_torque.png"),
        ),
        sampled,
    ),
    Group(("limits.png",), limits),
    Group(("contact.png", "contact.html"), contact),
    *(study(name) for name in ("polishing", "grip", "policy", "hands", "walls")),
    Group(("uncertainty.png",), uncertainty),
    Group(("cards.md", *(f"card_{name}.html" for name, _ in commanded())), cards),
)
