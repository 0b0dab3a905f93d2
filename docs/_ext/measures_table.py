"""The directive `measures-table`: what is measured of each sample of a campaign, read from the package."""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from passiflex.metrics.measures import MEASURES

COLUMNS = (("measure", 24), ("unit", 8), ("bad end", 10), ("meaning", 58))


def row(cells: tuple[nodes.Node, ...]) -> nodes.row:
    """Return a row of a table."""
    out = nodes.row()
    for cell in cells:
        out += nodes.entry("", nodes.paragraph("", "", cell))
    return out


class MeasuresTable(SphinxDirective):
    """One row for each measure."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        group = nodes.tgroup(cols=len(COLUMNS))
        group += [nodes.colspec(colwidth=width) for _, width in COLUMNS]
        group += nodes.thead("", row(tuple(nodes.Text(name) for name, _ in COLUMNS)))
        body = nodes.tbody()
        for name, measure in MEASURES.items():
            rest = (measure.unit, measure.worst, measure.meaning)
            body += row((nodes.literal("", name), *(nodes.Text(text) for text in rest)))
        group += body
        return [nodes.table("", group)]


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.add_directive("measures-table", MeasuresTable)
    return {"parallel_read_safe": True}
