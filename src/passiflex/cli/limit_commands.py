"""The commands that judge gains: limits, recommend."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import cyclopts

from passiflex.cli.terminal import console, progress_lines, timed

Task = Literal["pose", "position"]
InnerLoop = Literal["plain", "matched"]

if TYPE_CHECKING:
    from passiflex.limits import Recommendation
    from passiflex.simulation import Problem


def limits(
    scenario: Path,
    /,
    *,
    rate: Annotated[
        str | None, cyclopts.Parameter(help="control rate, as '1 kHz'; the scenario's own")
    ] = None,
    delay: Annotated[
        str | None, cyclopts.Parameter(help="of a command, as '1 ms'; the scenario's own")
    ] = None,
    task: Annotated[Task | None, cyclopts.Parameter(help="what the law holds; the scenario's own")] = None,
    inner_loop: Annotated[InnerLoop | None, cyclopts.Parameter(help="the scenario's own")] = None,
    recommend: Annotated[
        bool, cyclopts.Parameter(negative="", help="also find gains with a margin of 20 %")
    ] = False,
    why: Annotated[
        bool,
        cyclopts.Parameter(
            negative="", help="also all borders, other delays, and every remedy that was tried"
        ),
    ] = False,
    out: Annotated[Path | None, cyclopts.Parameter(help="folder for limits.png and limits.pdf")] = None,
) -> int:
    """Say which gains a scenario's robot bears at its rate and delay: exit status 0 if its own are stable, 1 if not.

    A scenario in continuous time needs --rate.
    """
    from passiflex.cli.limit_tables import border_table, confirmation_table, why_lines
    from passiflex.files import require_writable
    from passiflex.limits import limit_map
    from passiflex.limits.subject import sampled_problem

    with timed():
        with progress_lines() as report:
            problem = sampled_problem(scenario, rate, delay, task=task, inner_loop=inner_loop)
            if out is not None:
                require_writable(out)
            found = limit_map(problem, pictured=why or out is not None, report=report)
        console.print(found.sentence)
        if found.admissible.stable:
            console.print(found.margin.words)
        for line in why_lines(found) if why else ():
            console.print(line)
        console.print(border_table(found))
        console.print(confirmation_table(found))
        if recommend:
            _print_recommendation(problem, inner_loop)
        if out is not None:
            from passiflex.plotting.figures import save_figure
            from passiflex.plotting.limits import draw_limits

            for path in save_figure(draw_limits(found), out / "limits"):
                console.print(f"wrote {path}")
    return 0 if found.admissible.stable else 1


def recommend(
    subject: Annotated[
        str, cyclopts.Parameter(help="robot of the catalogue, robot file, or scenario file, by its path")
    ],
    /,
    *,
    rate: Annotated[
        str | None, cyclopts.Parameter(help="control rate, as '1 kHz'; of a scenario its own")
    ] = None,
    delay: Annotated[
        str | None, cyclopts.Parameter(help="of a command, as '1 ms'; of a scenario its own, else none")
    ] = None,
    margin: Annotated[
        str,
        cyclopts.Parameter(allow_leading_hyphen=True, help="by how much each number of the robot may be off"),
    ] = "20 %",
    task: Annotated[
        Task | None, cyclopts.Parameter(help="what the law holds; of a scenario its own, else pose")
    ] = None,
    inner_loop: Annotated[
        InnerLoop | None, cyclopts.Parameter(help="the better of the two if left out")
    ] = None,
) -> int:
    """Find gains that hold with a margin, as sections of a scenario, in YAML; exit status 2 if there are none.

    Of a robot alone with the stiffness and damping of `passiflex.recommend`, of a scenario with its own.
    """
    from passiflex import limits as room
    from passiflex.limits.subject import number
    from passiflex.robots.flexible import FlexibleJointRobot
    from passiflex.scenarios.scenario_file import is_scenario
    from passiflex.texts.quantity import Quantity

    with timed():
        share = number("margin", margin, Quantity("1", least=0))
        with progress_lines() as report:
            if is_scenario(subject):
                advice = room.recommend_for(
                    subject, share, rate, delay, task=task, inner_loop=inner_loop, report=report
                )
            else:
                robot = FlexibleJointRobot.load(subject)  # its mistakes before that there is no rate
                advice = room.recommend(
                    robot, _given(rate), delay or 0.0, share, task=task or "pose",
                    inner_loop=inner_loop, report=report,
                )  # fmt: skip
        _print_advice(advice)
    return 0


def _given(rate: str | None) -> str:
    from passiflex.errors import ValueRangeError

    if rate is None:
        raise ValueRangeError(
            "a robot alone has no control rate", needs="one beside it", try_="--rate '1 kHz'"
        )
    return rate


def _print_recommendation(problem: Problem, inner_loop: str | None) -> None:
    """Print gains with a margin, or why there are none."""
    from passiflex.errors import ValueRangeError
    from passiflex.limits import recommend_for

    try:
        with progress_lines() as report:
            advice = recommend_for(problem, inner_loop=inner_loop, report=report)
    except ValueRangeError as nothing:
        console.print(f"recommended: nothing; {nothing}")
        return
    _print_advice(advice)


def _print_advice(advice: Recommendation) -> None:
    """Print gains as they stand in a scenario file, what they are good for as comments, so that all can be piped."""
    for line in f"recommended: {advice.sentence}".splitlines():
        console.print(f"# {line}")
    console.print(advice.snippet)
