"""A card in words and tables: what all its forms, text, HTML and PDF, say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from passiflex.cards.border import BEGUN, Border, stiffness_of
from passiflex.cards.card import NOISE, Card, Row
from passiflex.cards.folklore import FOLKLORE, USUAL, Told
from passiflex.cards.setting import MARGIN, NEAREST, RATIO, ROTATION, SCALES, TOOL_CENTRE, TRANSLATION
from passiflex.cards.spread import range_of, uncertain
from passiflex.limits.margin_box import NEAR, SETTLING
from passiflex.origin import package_version
from passiflex.robots.once_over import once_over
from passiflex.stability.clock_words import delay_words, hertz

UNITS = {"translation": "N/m", "rotation": "N m/rad"}


LEAST_RATIO = RATIO * min(push for push, _ in SCALES)
NONE = (
    f"no K_x of {BEGUN['translation'][-1]:g} N/m or more with {LEAST_RATIO:.0%} of critical damping or more"
)
"""What *none* means, in words."""


class Table(NamedTuple):
    """A table: what its columns are, and its rows."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


class Block(NamedTuple):
    """A part of a card."""

    title: str
    lines: tuple[str, ...]
    table: Table | None = None


def sheet(card: Card) -> list[Block]:
    """Return the blocks of a card."""
    return [
        _answer(card),
        _stiffness(card),
        *([_slow(card)] if card.slow else []),
        _clocks(card),
        _shaping(card),
        _hangs(card),
        _folklore(card),
        _made(card),
    ]


def title(card: Card) -> str:
    """Return what a card is of."""
    return f"{card.robot.name} at {hertz(card.rate)} with {delay_words(card.delay * card.rate)}"


def _answer(card: Card) -> Block:
    seen, robot, surest, bare = once_over(card.robot), card.robot, card.surest.border, card.bare.border
    lines, turning = [], card.task == "pose"
    if bare.stiffness:
        lines.append(f"With its joints as they are in its file, {_advice(bare, turning=turning)}.")
        largest = _stiff(bare.stiffness, "translation")
        lines.append(
            f"Without shaping (K_e = K, B_e = B) K_x {largest} holds in translation; limit: {bare.why}."
        )
    else:
        lines.append(f"Nothing to advise: at this rate there is {NONE}; limit: {bare.why}.")
    if card.surest.over:
        ends = [(entry, range_of(robot, entry)) for entry in uncertain(robot)]
        words = ", ".join(f"{entry} {low:.2g} to {high:.2g} times" for entry, (low, high) in ends)
        sure = (
            f"To be sure whatever they are, {_advice(surest, turning=turning)}"
            if surest.stiffness
            else f"For all of these robots there is {NONE}: measure them before you trust the first line"
        )
        lines.append(f"Assumed, or not well known: {words}, all joints alike. {sure}.")
    lines.append(
        f"{robot.n} joints, {seen.mass:.3g} kg that move, {seen.reach:.3g} m; motors held, its links swing at "
        f"{seen.swing:.3g} Hz and more, and the springs of its joints give way as {_short(card.springs)} N/m does in "
        "the softest direction, on average over the postures: no gain makes that stiffer, and none is looked for."
    )
    return Block("Answer", tuple(lines))


def _advice(b: Border, *, turning: bool) -> str:
    """Return gains with room to all sides."""
    k, d = _stiff(b.stiffness / 2, b.part).removeprefix("up to "), b.damping
    turn = stiffness_of(b.part, b.stiffness / 2)[1]
    rotation = f", rotation at {turn:.2g} N m/rad with {d.beside:.3g} N m s/rad" if turning else ""
    return (
        f"set K_x to {k} or less with D_x from {_short(d.least)} to {_short(d.most)} N s/m at that{rotation}"
    )


def summary(card: Card) -> tuple[str, str, str]:
    """Return its answer in three cells: the largest K_x of translation, that over what is assumed, the lowest rate."""
    surest = _stiff(card.surest.border.stiffness, "translation") if card.surest.over else "nothing is"
    usual = next(clock for clock in card.clocks if clock.stiffness == USUAL)
    return _stiff(card.bare.border.stiffness, "translation"), surest, _rate(usual.rate)


def _stiffness(card: Card) -> Block:
    turning = card.task == "pose"
    rows = tuple(_row(row, turning=turning) for row in card.rows)
    columns = ("tool", "joints", "of", "largest K_x", "with D_x", "D_x at half of that K_x", "limit")
    return Block("Largest safe K_x", (_dampings(turning=turning),), Table(columns, rows))


def _dampings(*, turning: bool) -> str:
    if not turning:
        return "D_x in N s/m."
    return (
        f"D_x of translation in N s/m; of rotation in N m s/rad. The other K_x is {ROTATION:g} N m/rad or "
        f"{TRANSLATION:g} N/m; where this one is below its own of the two, in their ratio."
    )


def _row(row: Row, *, turning: bool) -> tuple[str, ...]:
    b = row.border
    tool = f"{row.tool:g} kg" if row.tool else "none"
    joints = "shaped" if row.shaped else "anywhere in range" if row.over else "as they are"
    return tool, joints, b.part, _stiff(b.stiffness, b.part), *_damped(b, turning=turning), b.why


def _damped(b: Border, *, turning: bool) -> tuple[str, str]:
    """Return D_x with the largest K_x, and at half of it."""
    if math.isnan(b.damping.least):
        return "–", "–"
    push, turn, least, most, beside = map(_short, (*b.there, *b.damping))
    half = f"{least} to {most}"
    if not turning:
        return push, half
    return f"{push}; {turn}", f"{half}; {beside}" if b.part == "translation" else f"{beside}; {half}"


def _short(value: float) -> str:
    """Return three digits of a number, without an exponent."""
    return f"{float(f'{value:.3g}'):g}"


def _stiff(value: float, part: str) -> str:
    """Return a stiffness, rounded down."""
    if value == 0:
        return "none"
    size = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"up to {math.floor(value / size) * size:g} {UNITS[part]}"


def _slow(card: Card) -> Block:
    rows = tuple(
        (hertz(at.rate), *_row(Row(0.0, False, at.border), turning=card.task == "pose")[3:])
        for at in card.slow
    )
    return Block(
        "At other rates",
        (f"Translation, joints as they are, no tool, {delay_words(card.delay * card.rate)}.",),
        Table(("rate", "largest K_x", "with D_x", "D_x at half of that K_x", "limit"), rows),
    )


def _clocks(card: Card) -> Block:
    rows = tuple(
        (
            f"{c.stiffness:g} N/m",
            f"{c.tool:g} kg" if c.tool else "none",
            _rate(c.rate),
            "none" if math.isnan(c.delay) else f"{math.floor(1e4 * c.delay) / 10:g} ms",
        )
        for c in card.clocks
    )
    periods = delay_words(card.delay * card.rate)
    return Block(
        "Lowest rate and longest delay",
        ("Joints as they are.",),
        Table(("K_x", "tool", f"lowest rate, {periods}", f"longest delay at {hertz(card.rate)}"), rows),
    )


def _rate(rate: float) -> str:
    return "none" if math.isinf(rate) else f"{math.ceil(rate):d} Hz"


def _shaping(card: Card) -> Block:
    if card.shaping is None or card.inertia is None:
        return Block("Shaping", (f"None: {card.why_not}.",))
    found, robot = card.shaping, card.robot
    raised = float((card.inertia / found.shaped_inertia)[0])
    shares = found.torque_noise / found.torque_limit
    loudest = int(np.argmax(shares))
    names = [joint.name for joint in robot.arm.chain.joints]
    rows = tuple(
        (name, f"{B:.3g}", f"{B / own:.2g}", why)
        for name, B, own, why in zip(names, card.inertia, robot.motor_inertia, found.decided_by, strict=True)
    )
    more = (
        f" {raised:.3g} times what the bare flange needs, so that the tools are borne." if raised > 1 else ""
    )
    lines = (
        f"K_e = K with the {found.inner_loop} inner loop.{more}",
        f"Noise of the torque sensors, {NOISE:g} (N m)^2, makes {found.torque_noise[loudest]:.2g} N m rms in the motor "
        f"of {names[loudest]}, {100 * shares[loudest]:.0f} % of its limit.",
    )
    return Block("Shaping", lines, Table(("joint", "B_e, kg m^2", "B_e/B", "decided by"), rows))


def _hangs(card: Card) -> Block:
    rows = tuple(
        (
            h.entry,
            h.known,
            f"{h.shares[0]:.2g} to {h.shares[1]:.2g} times",
            f"{h.rates[0]:.2g} to {h.rates[1]:.2g} times",
        )
        for h in card.hangs
    )
    columns = ("number", "known", "looked at", f"lowest rate for {USUAL:g} N/m")
    return Block(
        "What the answer hangs on",
        ("Of the robots that have mostly decided, without a search.",),
        Table(columns, rows),
    )


def _folklore(card: Card) -> Block:
    rows = tuple((told.said, *_becomes(told)) for told in card.folklore)
    return Block(
        "What people say, simulated",
        (
            f"2 √K damping; {FOLKLORE:g} N/m as a typical largest stiffness. A push, and a step of 10 mm, on the robot "
            "of the margin that likes it least.",
        ),
        Table(("gains", "a push", "a step overshoots by"), rows),
    )


def _becomes(told: Told) -> tuple[str, str]:
    if told.growth >= 1:
        return f"trembles at {told.frequency:.0f} Hz, and grows", "–"
    if math.isnan(told.overshoot):
        return "dies out", "–"
    return "dies out", f"{100 * max(told.overshoot, 0):.0f} %"


def _made(card: Card) -> Block:
    task = "pose" if card.task == "pose" else "position, as the arm has too few joints for a pose"
    return Block("How it was found, and again", tuple(_how(card, task)))


def _how(card: Card, task: str) -> Iterator[str]:
    few = "with tools, for other rates and delays" if card.sensed else "for rates and delays with a tool"
    yield (
        f"Safe: the sampled loop is stable at {len(card.postures)} postures over the workspace on every robot that was "
        f"tried of a box: B, K, D and the links' inertia of each joint off by {100 * MARGIN:g} %, the delay by "
        f"{MARGIN:g} periods, joints up to {NEAR:g} rad beside. A search goes uphill in it, for what does not die out "
        f"at {SETTLING:g} 1/s or faster; in range, {few} and for the ends of D_x at the {NEAREST} postures nearest to "
        "the limit."
    )
    yield (
        f"Task: {task}. Velocities are differences of readings. D_x in steps of √2, and less than {LEAST_RATIO:.0%} of "
        f"critical by the inertia that moves is not tried. A tool is a body {1e3 * TOOL_CENTRE:g} mm above the flange, "
        "known to the law."
    )
    yield f"None: {NONE}, by the inertia that moves as the robot file has it."
    yield "Not in it: play and stiction, limits of torque, resolution of encoders, contact with anything."
    yield f"Made by passiflex {package_version()}: {card.command}"
