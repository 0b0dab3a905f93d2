"""The commands on one robot: robot new, robot check."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cyclopts

from passiflex.cli.terminal import console

if TYPE_CHECKING:
    from passiflex.robots.flexible import FlexibleJointRobot
    from passiflex.robots.once_over import OnceOver


NOTHING = 1e-9
"""[N m, N] A weight that is none."""


def new(
    urdf: Path,
    /,
    *,
    base: Annotated[str | None, cyclopts.Parameter(help="link from which on joints are the arm's")] = None,
    end_effector: Annotated[str | None, cyclopts.Parameter(help="link that is held")] = None,
    drive: Annotated[
        str | None, cyclopts.Parameter(help="class of the drives: sensed, industrial, servo, direct")
    ] = None,
    xacro: Annotated[
        tuple[str, ...],
        cyclopts.Parameter(help="an argument of a xacro template, as ur_type=ur5e; once for each"),
    ] = (),
    out: Annotated[
        Path | None, cyclopts.Parameter(help="file to write; the URDF's name with .yaml if left out")
    ] = None,
) -> int:
    """Write a robot file for a URDF: its arm, limits and masses, and estimates of K, D and B with a range and a reason.

    The longest chain without names; a xacro is expanded where the package xacrodoc is there.
    """
    from passiflex.errors import PassiflexError, RobotError
    from passiflex.files import OutputError, require_writable, whole_file
    from passiflex.robots.catalogue import read_description
    from passiflex.robots.doubts import doubts
    from passiflex.robots.flexible import FlexibleJointRobot
    from passiflex.robots.new_file import new_robot_file
    from passiflex.robots.xacro import expanded

    if not urdf.exists():
        raise RobotError("there is no such file", got=str(urdf), needs="a URDF, or a template of xacro")
    target = out or urdf.with_name(urdf.name.split(".")[0] + ".yaml")
    if target.exists():
        raise OutputError("the file to write is there already", got=str(target), try_="--out OTHER.yaml")
    require_writable(target.parent)
    plain = expanded(urdf, target.with_suffix(".urdf"), _pairs(xacro))
    try:
        made = new_robot_file(
            plain,
            base=base,
            end_effector=end_effector,
            drive=drive,
            folder=target.parent.resolve(),
            name=target.stem,
        )
    except PassiflexError:
        if plain != urdf:
            plain.unlink()  # an expansion that is of no use
        raise
    with whole_file(target) as temporary:
        temporary.write_text(made.text, encoding="utf-8")
    for remark in made.read.remarks:
        console.print(remark)
    console.print(f"wrote {target}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is said of the URDF stands above
        robot = FlexibleJointRobot.load(target)
    for doubt in doubts(read_description(target)):
        console.print(f"looks wrong: {doubt}")
    _print(robot)
    _hang(robot)
    console.print(
        f"assumed, for {made.drive} drives{'' if drive else ', which is a guess: --drive says which they are'}: "
        f"joint_stiffness, joint_damping, motor_inertia, torque sensors; which gains are safe: "
        f"passiflex card {target} --rate '1 kHz' --delay '1 ms'"
    )
    return 0


def _hang(robot: FlexibleJointRobot) -> None:
    """Print what of the file the answer hangs on most, where it can be told."""
    from passiflex.cards.card import hangs
    from passiflex.cards.folklore import USUAL
    from passiflex.errors import PassiflexError

    try:
        found = hangs(robot)
    except PassiflexError:
        return
    for hang in sorted(found, key=lambda h: -max(h.rates) / min(h.rates)):
        low, high = min(hang.rates), max(hang.rates)
        console.print(
            f"over its range {hang.entry} changes the lowest rate for {USUAL:g} N/m from {low:.2g} to {high:.2g} times"
        )


def _pairs(written: tuple[str, ...]) -> dict[str, str]:
    from passiflex.errors import ArgumentError

    for pair in written:
        if "=" not in pair:
            raise ArgumentError(pair, "NAME=VALUE", "ur_type=ur5e, with no spaces")
    pairs = (pair.replace(":=", "=", 1).split("=", 1) for pair in written)
    return dict(pairs)


def check(robot: str, /) -> int:
    """Look a robot over: reach, masses, weight against torque limits, lowest elastic frequency, what looks wrong."""
    from passiflex.robots.flexible import FlexibleJointRobot

    _print(FlexibleJointRobot.load(robot))
    return 0


def _print(robot: FlexibleJointRobot) -> None:
    from passiflex.robots.once_over import oddities, once_over

    seen = once_over(robot)
    console.print(_table(robot, seen))
    name = robot.arm.chain.joints[seen.swings].name
    console.print(
        f"it reaches {seen.reach:.3g} m from its first joint; all that moves weighs {seen.mass:.3g} kg"
    )
    console.print(f"motors held, its links swing at {seen.swing:.3g} Hz and more, slowest at {name!r}")
    console.print(f"motors free, the slowest resonance of a joint is at {seen.resonance:.3g} Hz")
    assumed = [entry for entry in robot.sources if robot.assumed(entry)]
    if assumed:
        console.print(f"assumed: {', '.join(assumed)}")
    for oddity in oddities(robot, seen):
        console.print(f"looks wrong: {oddity}")


def _table(robot: FlexibleJointRobot, seen: OnceOver) -> object:
    from rich.table import Table

    chain = robot.arm.chain
    table = Table("joint", "link", "K", "D", "B", "weight, at most", "torque limit", title=robot.name)
    for i, (joint, body) in enumerate(zip(chain.joints, chain.bodies, strict=True)):
        table.add_row(
            joint.name,
            f"{body.mass:.3g} kg",
            f"{robot.joint_stiffness[i]:.3g}",
            f"{robot.joint_damping[i]:.3g}",
            f"{robot.motor_inertia[i]:.3g}",
            f"{seen.weight[i] if seen.weight[i] > NOTHING else 0:.3g}",
            f"{robot.torque_limit[i]:.4g}",
        )
    return table


def card(
    robot: str,
    /,
    *,
    rate: Annotated[str, cyclopts.Parameter(help="control rate, as '1 kHz'")],
    delay: Annotated[
        str | None, cyclopts.Parameter(help="of a command, as '1 ms'; one period if left out")
    ] = None,
    sensed: Annotated[
        bool | None, cyclopts.Parameter(help="whether it has torque sensors; as its file says if left out")
    ] = None,
    out: Annotated[
        Path | None,
        cyclopts.Parameter(help="folder for ROBOT.html, .pdf and .txt; the page alone is printed without"),
    ] = None,
) -> int:
    """Make the card of an arm: the largest safe gains at a rate, what limits them, and what people say, simulated."""
    from passiflex.cards import card as card_of
    from passiflex.cli.terminal import progress_lines, timed
    from passiflex.files import require_writable
    from passiflex.reports.card_page import FORMS, card_text, write_card

    with timed():
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            require_writable(out)
        with progress_lines() as report:
            made = card_of(robot, rate, delay, sensed=sensed, report=report)
        console.print(card_text(made), markup=False, highlight=False, soft_wrap=True)
        for form in FORMS if out is not None else ():
            console.print(f"wrote {write_card(made, (out or Path()) / f'{made.robot.name}{form}')}")
    return 0
