"""Figures and reports of the pages, made by the package while they are built, into `docs/generated`."""

from __future__ import annotations

import logging as python_logging
import shutil
import tempfile
import time
from pathlib import Path

from docutils import nodes
from makers import GROUPS, LARGEST, Group
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging
from sphinx.util.docutils import ReferenceRole

SOURCE = Path(__file__).parents[2] / "src" / "passiflex"
SUFFIXES = (".py", ".c", ".h", ".yaml", ".js", ".css")
log = logging.getLogger(__name__)


def make(app: Sphinx) -> None:
    """Make every group of which a file is missing, or older than the package."""
    sources = [path for path in SOURCE.rglob("*") if path.suffix in SUFFIXES]
    changed = max(path.stat().st_mtime for path in [*sources, Path(__file__).with_name("makers.py")])
    target = Path(app.srcdir) / "generated"
    target.mkdir(exist_ok=True)
    python_logging.getLogger("fontTools").setLevel(python_logging.WARNING)  # it tells of every font in a PDF
    for group in GROUPS:
        files = [target / name for name in group.names]
        if not all(file.exists() and file.stat().st_mtime > changed for file in files):
            _make_group(group, target)


def _make_group(group: Group, target: Path) -> None:
    """Make the files of one group, all or none."""
    from passiflex.errors import PassiflexError

    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        try:
            group.make(Path(folder))
        except PassiflexError as error:
            raise ExtensionError(f"{', '.join(group.names)} cannot be made: {error}") from error
        for name in group.names:
            size = (Path(folder) / name).stat().st_size
            if size > LARGEST:
                raise ExtensionError(f"{name} has {size} bytes, more than {LARGEST}")
            shutil.copy(Path(folder) / name, target)
    log.info("made %s in %.0f s", ", ".join(group.names), time.perf_counter() - start)


def copy_reports(app: Sphinx, exception: Exception | None) -> None:
    """Put the reports where the pages link to them: into `reports` beside the pages."""
    if exception is not None or app.builder.format != "html":
        return
    target = Path(app.outdir) / "reports"
    target.mkdir(exist_ok=True)
    for group in GROUPS:
        for name in group.names:
            if name.endswith(".html"):
                shutil.copy(Path(app.srcdir) / "generated" / name, target)


class ReportRole(ReferenceRole):
    """A link to a report: {report}`text <name>`."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Return the link."""
        if not any(f"{self.target}.html" in group.names for group in GROUPS):
            message = self.inliner.reporter.error(f"no report is made under the name {self.target!r}")
            return [], [message]
        return [nodes.reference("", self.title, refuri=f"reports/{self.target}.html")], []


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.add_role("report", ReportRole())
    app.connect("builder-inited", make)
    app.connect("build-finished", copy_reports)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
