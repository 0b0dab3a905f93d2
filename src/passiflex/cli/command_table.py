"""The commands: what each is called, where its function is, and what one wants when one calls it."""

from __future__ import annotations

from typing import NamedTuple


class Command(NamedTuple):
    """A command.

    Attributes
    ----------
    name: What is typed.
    place: Where its function is, as "module:function"; it is imported when the command is called.
    line: What it does, on the line that it has in the list of all.
    """

    name: str
    place: str
    line: str


_MANY, _ONE, _LIMITS, _ROBOT, _SEEN, _ON = (
    f"passiflex.cli.{module}:"
    for module in (
        "campaign_commands",
        "commands",
        "limit_commands",
        "robot_commands",
        "view_commands",
        "on_commands",
    )
)

GROUPS = {
    "run": (
        Command("simulate", _ONE + "simulate", "run a scenario file"),
        Command("reproduce", _ONE + "reproduce", "make the paper's figures again, or a study"),
        Command("keys", _ONE + "keys", "list what may be written in a scenario file"),
        Command(
            "robots", _ONE + "robots", "list the robots that are here, and where their numbers come from"
        ),
    ),
    "your arm": (
        Command("robot new", _ROBOT + "new", "write a robot file for a URDF"),
        Command("robot check", _ROBOT + "check", "look a robot over"),
        Command("card", _ROBOT + "card", "say on one page which gains are safe for it, and what limits them"),
    ),
    "judge": (
        Command("audit", _ONE + "audit", "say whether a run was passive"),
        Command("limits", _LIMITS + "limits", "say which gains hold at a rate and a delay"),
        Command("recommend", _LIMITS + "recommend", "find gains that hold with a margin"),
    ),
    "look": (
        Command("show", _SEEN + "show", "write a run as a page: the moving arm beside its signals"),
        Command("plot", _SEEN + "plot", "draw a run for a paper or a slide"),
        Command("export", _SEEN + "export", "write a run for Rerun, Foxglove, PlotJuggler, or as a table"),
        Command("export-model", _SEEN + "export_model", "write a robot as a model for MuJoCo"),
    ),
    "on a robot": (
        Command("run", _ON + "run", "run a scenario on a robot, or on a twin of it, in real time"),
        Command("export-law", _ON + "export_law", "write the law of a scenario as C, with its own test"),
    ),
    "many robots": (
        Command("campaign", _MANY + "campaign", "run a scenario for thousands of robots"),
        Command("replay", _MANY + "replay", "make the full run of one of them"),
        Command("search", _MANY + "search", "look for the worst case"),
    ),
}
"""What one wants → the commands for it."""

EXAMPLES = (
    "passiflex reproduce fig1 --out results",
    "passiflex show results/fig1_proposed.nc",
    "passiflex recommend iiwa14 --rate '1 kHz' --delay '1 ms'",
)
"""To be copied: each works as it is, after those above it."""
