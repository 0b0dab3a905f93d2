"""The directive `robots-table`: the arms of the catalogue and where their numbers are from, read from the package."""

from __future__ import annotations

from collections.abc import Iterator

from docutils import nodes
from measures_table import row
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from passiflex.robots.catalogue import RobotDescription, catalogue, read_description

COLUMNS = (("name", 12), ("arm", 30), ("links", 34), ("joints", 44))
SYMBOLS = {"joint_stiffness": "K", "joint_damping": "D", "motor_inertia": "B"}


def joints(robot: RobotDescription) -> Iterator[str]:
    """Yield what is said of K, D and B, those of one source together."""
    said: dict[str, str] = {}
    for entry, symbol in SYMBOLS.items():
        source = robot.sources[entry]
        known = source if not source.lower().startswith("assumed") else "assumed"
        low, high = robot.ranges.get(entry, (1.0, 1.0))
        text = known if low == high else f"{known}, {low:.2g} to {high:.2g} times"
        said[text] = f"{said[text]}, {symbol}" if text in said else symbol
    yield from (f"{symbols}: {text}" for text, symbols in said.items())


class RobotsTable(SphinxDirective):
    """One row for each robot."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        group = nodes.tgroup(cols=len(COLUMNS))
        group += [nodes.colspec(colwidth=width) for _, width in COLUMNS]
        group += nodes.thead("", row(tuple(nodes.Text(name) for name, _ in COLUMNS)))
        body = nodes.tbody()
        for name in catalogue():
            robot = read_description(name)
            rest = (robot.description, robot.sources["links"], ". ".join(joints(robot)))
            body += row((nodes.literal("", name), *(nodes.Text(text) for text in rest)))
        group += body
        return [nodes.table("", group)]


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.add_directive("robots-table", RobotsTable)
    return {"parallel_read_safe": True}
