"""Figures of the pages, made by the package while the documentation is built, into `docs/generated`."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util import logging

SOURCE = Path(__file__).parents[2] / "src" / "passiflex"
log = logging.getLogger(__name__)


def sampled(folder: Path) -> Path:
    """Return the figure of the study `sampled`."""
    from passiflex.studies.sampled import reproduce_sampled

    reproduce_sampled(folder)
    return folder / "sampled.png"


def limits(folder: Path) -> Path:
    """Return the limit map of `fig1_sampled` with the continuous law at the samples and B_e = 0.3 B."""
    from passiflex.limits import limit_map
    from passiflex.plotting.figures import save_figure
    from passiflex.plotting.limits import draw_limits
    from passiflex.simulation import resolve
    from passiflex.simulation.law_settings import ShapedInertia
    from passiflex.studies import shipped_scenario

    scenario = shipped_scenario("fig1_sampled")
    control = scenario.control.model_copy(update={"inner_loop": "plain"})
    law = scenario.law.model_copy(update={"shaped_inertia": ShapedInertia(ratio=0.3)})
    found = limit_map(resolve(scenario.model_copy(update={"control": control, "law": law})))
    save_figure(draw_limits(found), folder / "limits")
    return folder / "limits.png"


def uncertainty(folder: Path) -> Path:
    """Return the figure of the study `uncertainty`, of fewer robots than the study has."""
    from passiflex.studies.uncertainty import reproduce_uncertainty

    reproduce_uncertainty(folder, samples=64)
    return folder / "uncertainty.png"


MAKERS: dict[str, Callable[[Path], Path]] = {
    "sampled.png": sampled,
    "limits.png": limits,
    "uncertainty.png": uncertainty,
}


def make(app: Sphinx) -> None:
    """Make every figure that is missing, or older than the package."""
    changed = max(
        path.stat().st_mtime for path in SOURCE.rglob("*") if path.suffix in (".py", ".c", ".h", ".yaml")
    )
    target = Path(app.srcdir) / "generated"
    target.mkdir(exist_ok=True)
    for name, maker in MAKERS.items():
        figure = target / name
        if figure.exists() and figure.stat().st_mtime > changed:
            continue
        log.info("making %s", name)
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(maker(Path(folder)), figure)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("builder-inited", make)
    return {"parallel_read_safe": True}
