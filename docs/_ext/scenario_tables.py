"""The directives `scenario-table`, the entries of one section of a scenario file, and `tank-table`, read from the code.

A table cannot differ from the package: key, what may be written, default and meaning are those of
`passiflex.scenarios.scenario`.
"""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from passiflex.scenarios.keys import keys_of, sections
from passiflex.scenarios.tank_settings import TankSettings
from passiflex.scenarios.tank_uses import CONTINUOUS, SAMPLED, Uses

COLUMNS = (("key", 22), ("write", 30), ("default", 12), ("meaning", 36))


class ScenarioTable(SphinxDirective):
    """`scenario-table:: NAME` with NAME the class of a section."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        known = {s.__name__: s for s in sections()}
        if self.arguments[0] not in known:
            raise self.error(f"no section {self.arguments[0]!r}; one of {', '.join(known)}")
        rows = keys_of(known[self.arguments[0]])
        table, group = nodes.table(classes=["scenario"]), nodes.tgroup(cols=len(COLUMNS))
        group += [nodes.colspec(colwidth=width) for _, width in COLUMNS]
        head, body = nodes.thead(), nodes.tbody()
        head += _row([nodes.Text(title) for title, _ in COLUMNS])
        body += [_row([nodes.literal(text=r[0]), *map(nodes.Text, r[1:])]) for r in rows]
        group += [head, body]
        table += group
        return [table]


class TankTable(SphinxDirective):
    """`tank-table::`, which kind of tank goes by which of its settings, read from the code."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        kinds = {"paper, in continuous time": CONTINUOUS} | SAMPLED
        names = [n for n in TankSettings.model_fields if n not in ("kind", "initial")]
        table, group = nodes.table(classes=["scenario"]), nodes.tgroup(cols=len(kinds) + 1)
        group += [nodes.colspec(colwidth=1) for _ in range(len(kinds) + 1)]
        head, body = nodes.thead(), nodes.tbody()
        head += _row([nodes.Text(title) for title in ("setting", *kinds)])
        for name in names:
            body += _row([nodes.literal(text=name), *(nodes.Text(_used(t, name)) for t in kinds.values())])
        group += [head, body]
        table += group
        return [table]


def _used(uses: Uses, name: str) -> str:
    return "yes" if name in uses.always else "yes (v)" if name in uses.gates else "–"


def _row(cells: list[nodes.Node]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", nodes.paragraph("", "", cell))
    return row


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("scenario-table", ScenarioTable)
    app.add_directive("tank-table", TankTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
