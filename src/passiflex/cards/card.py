"""The card of an arm: which gains are safe at its rate, and what limits them."""

from __future__ import annotations

import dataclasses
import math
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.cards.border import LATEST, Border, border, borne, longest_delay, searched, slowest_clock
from passiflex.cards.folklore import USUAL, Told, folklore
from passiflex.cards.setting import MARGIN, ROTATION, Setting
from passiflex.cards.spread import ENTRIES, Spread, at_shares, range_of
from passiflex.control.task import PoseTask, PositionTask
from passiflex.errors import PassiflexError, ValueRangeError
from passiflex.limits import Recommendation, recommend
from passiflex.limits.one_thread import on_one_thread
from passiflex.limits.subject import DELAY, RATE, number
from passiflex.limits.workspace import workspace_postures
from passiflex.robots.flexible import FlexibleJointRobot

Array = NDArray[np.float64]
Report = Callable[[str], None]

TOOLS = (0.5, 1.0, 2.0)
"""[kg] Masses on the flange beside none."""
STIFFNESSES = (200.0, 500.0, 1000.0, 3000.0)
"""[N/m] For which the slowest clock and the longest delay are looked for."""
SLOW = (100.0, 125.0, 200.0, 500.0)
"""[Hz] Rates at which arms without torque sensors are commanded."""
RAISED, MOST_RAISED = 1.15, 16.0
"""By which B_e of all joints is raised for the tools, and most."""
NOISE = 0.2
"""[(N m)²] Variance of the torque sensors' noise."""
LEAST_POSE = 6
"""Joints of an arm that a pose is asked of; with fewer it is a position."""


class Row(NamedTuple):
    """One way to run the arm, with its border; over a spread it holds for all that is assumed of the arm."""

    tool: float
    shaped: bool
    border: Border
    over: bool = False


class Slow(NamedTuple):
    """A rate [Hz] that other interfaces have, with the border of translation at it."""

    rate: float
    border: Border


class Clock(NamedTuple):
    """The lowest rate [Hz] and the longest delay [s] for a stiffness [N/m], with a tool [kg] or none."""

    stiffness: float
    rate: float
    delay: float
    tool: float = 0.0


class Hang(NamedTuple):
    """An entry of the robot file at both ends of its range: how the lowest rate changes, and how well it is known."""

    entry: str
    shares: tuple[float, float]
    rates: tuple[float, float]
    known: str


@dataclass(frozen=True, eq=False)
class Card:
    """What is safe for an arm at a rate.

    Attributes
    ----------
    robot, rate, delay, task: What it is for; [Hz], [s].
    sensed: Whether the arm has torque sensors, so that joints can be shaped.
    postures: (p, n) rad.
    rows: Largest K_x and its damping, by tool and shaping.
    slow: The same at the rates of other interfaces, for an arm without torque sensors.
    clocks: Without shaping, bare flange and with the heaviest tool.
    springs: What the joint springs alone are at the end effector [N/m].
    shaping: What was found of B_e on the bare flange; None where the arm cannot shape.
    why_not: Why there is no shaping; empty if there is.
    inertia: B_e (n,) [kg m²] that bears the tools too.
    hangs: How the lowest rate hangs on what is assumed.
    folklore: What people say.
    command: By which the card is made again, in words if by none.
    """

    robot: FlexibleJointRobot
    rate: float
    delay: float
    task: str
    sensed: bool
    postures: Array
    rows: tuple[Row, ...]
    slow: tuple[Slow, ...]
    clocks: tuple[Clock, ...]
    springs: float
    shaping: Recommendation | None
    why_not: str
    inertia: Array | None
    hangs: tuple[Hang, ...]
    folklore: tuple[Told, ...]
    command: str

    @property
    def bare(self) -> Row:
        """Return the border of translation without tool and shaping."""
        return self.rows[0]

    @property
    def surest(self) -> Row:
        """Return the same over all that is assumed of the arm, where something is."""
        return next((row for row in self.rows if row.over), self.bare)


@on_one_thread
def card(
    robot: FlexibleJointRobot | str | Path,
    rate: float | str,
    delay: float | str | None = None,
    *,
    sensed: bool | None = None,
    report: Report = lambda text: None,
) -> Card:
    """Return the card of an arm at a control rate and a delay.

    Parameters
    ----------
    robot: Or its name in the catalogue, or the path of its file.
    rate, delay: [Hz], [s]; text may name a unit. One period of delay if left out, as no arm has none.
    sensed: Whether it has torque sensors; as its file says if left out, and yes where that says nothing.
    report: Is told what is being done.

    Raises
    ------
    PassiflexError
        For an unknown robot, a rate or delay that makes no sense, an arm without regular postures.
    """
    arm = robot if isinstance(robot, FlexibleJointRobot) else FlexibleJointRobot.load(robot)
    hertz = number("rate", rate, RATE)
    late = 1 / hertz if delay is None else number("delay", delay, DELAY)
    if late * hertz > LATEST:
        raise ValueRangeError(
            "delay", got=f"{late:g} s", needs=f"at most {LATEST:g} periods, {LATEST / hertz:g} s"
        )
    told = arm.sensed if sensed is None else sensed
    task = _task(arm)
    report(f"{arm.name}: compiling")
    places = workspace_postures(arm, PoseTask() if task == "pose" else PositionTask())
    own = Setting(arm, hertz, late, places, task)
    rows = _rows(own, shaped=False, told=told, report=report)
    shaping, why = (None, "the arm measures no joint torque") if not told else _shaping(own, report)
    shaped = None if shaping is None else _shaped(own, shaping)
    if shaped is None:
        shaping, why = None, why or f"no B_e was found that bears tools of up to {TOOLS[-1]:g} kg"
    else:
        rows += _rows(shaped, shaped=True, told=told, report=report)
    report(f"{arm.name}: clocks")
    heavy = dataclasses.replace(own, tool=TOOLS[-1], _members=list(own.members))
    ways = ((own, not told), (heavy, False))  # where nothing is shaped there is time for all postures
    clocks = tuple(
        Clock(k, slowest_clock(way, k, thorough=whole), longest_delay(way, k, thorough=whole), way.tool)
        for way, whole in ways
        for k in STIFFNESSES
    )
    report(f"{arm.name}: what it hangs on")
    hanging = tuple(_hangs(own))
    report(f"{arm.name}: folklore")
    if isinstance(robot, FlexibleJointRobot):
        command = f"pf.card of {arm.name!r} as it is in memory, at {hertz:g} Hz with {1e3 * late:g} ms"
    else:
        command = (
            f"passiflex card {shlex.quote(str(robot))} --rate '{hertz:g} Hz' --delay '{1e3 * late:g} ms'"
        )
        command += "" if sensed is None else " --sensed" if sensed else " --no-sensed"
    return Card(
        robot=arm,
        rate=hertz,
        delay=late,
        task=task,
        sensed=told,
        postures=places,
        rows=tuple(rows),
        slow=() if told else tuple(_slow(own, rows[0].border, report)),
        clocks=clocks,
        springs=own.springs["translation"],
        shaping=shaping,
        why_not=why,
        inertia=None if shaped is None else shaped.inertia,
        hangs=hanging,
        folklore=tuple(folklore(own)),
        command=command,
    )


@on_one_thread
def hangs(robot: FlexibleJointRobot, rate: float = 1000.0, places: int = 2) -> tuple[Hang, ...]:
    """Return how the lowest rate of an arm hangs on what its file may assume, at few postures and one period late.

    Raises
    ------
    PassiflexError
        For an arm without regular postures.
    """
    task = _task(robot)
    found = workspace_postures(robot, PoseTask() if task == "pose" else PositionTask(), places)
    return tuple(_hangs(Setting(robot, rate, 1 / rate, found, task)))


def _task(robot: FlexibleJointRobot) -> str:
    return "pose" if robot.n >= LEAST_POSE else "position"


def _rows(setting: Setting, *, shaped: bool, told: bool, report: Report) -> list[Row]:
    parts = ("translation", "rotation") if setting.task == "pose" else ("translation",)
    way = "with shaping" if shaped else "without shaping"
    out = []
    for part in parts:
        report(f"{setting.robot.name}: largest K_x of {part}, {way}")
        out.append(Row(0.0, shaped, border(setting, part)))
    spread, bare = Spread.over(setting), out[0].border
    if len(spread.settings) > 1 and not shaped:
        report(f"{setting.robot.name}: largest K_x over what is assumed")
        over = border(spread, bare.part, thorough=False, most=bare.stiffness) if bare.stiffness else bare
        if over.stiffness == bare.stiffness:  # it is the robot as its file has it that decides
            over = over._replace(mode=bare.mode, joint=bare.joint, posture=bare.posture)
        out.append(Row(0.0, shaped, over, over=True))
    for mass in TOOLS:
        report(f"{setting.robot.name}: largest K_x with {mass:g} kg, {way}")
        carrying = dataclasses.replace(setting, tool=mass, _members=list(setting.members))
        out.append(Row(mass, shaped, border(carrying, "translation", thorough=not told)))
    return out


def _slow(own: Setting, bare: Border, report: Report) -> Iterator[Slow]:
    """Yield the border of translation at the rates of other interfaces, with the delay in periods that the arm has."""
    for rate in SLOW:
        if rate == own.rate:
            yield Slow(rate, bare)
            continue
        report(f"{own.robot.name}: largest K_x at {rate:g} Hz")
        yield Slow(rate, border(own.at(rate, own.delay * own.rate / rate), "translation"))


def _shaping(own: Setting, report: Report) -> tuple[Recommendation | None, str]:
    """Return gains that shape the joints with a margin, or why there are none."""
    gains = own.gains(USUAL, ROTATION)
    try:
        found = recommend(
            own.robot, own.rate, own.delay, MARGIN, task=own.task, stiffness=gains["stiffness"],
            damping=gains["damping"], sensors={"velocity": "differences"}, torque_noise=NOISE,
            postures=own.postures, report=report,
        )  # fmt: skip
    except PassiflexError as error:
        return None, str(error)
    return found, ""


def _shaped(own: Setting, found: Recommendation) -> Setting | None:
    """Return the setting with the B_e that was found, raised for all joints until it bears the tools, if any does."""
    factor = 1.0
    while factor < MOST_RAISED:
        inertia = factor * found.shaped_inertia
        ways = [
            dataclasses.replace(own, inner_loop=found.inner_loop, inertia=inertia, tool=mass, _members=[])
            for mass in (0.0, *TOOLS)
        ]
        if all(borne(way, "translation", USUAL) for way in ways) and all(
            searched(way, "translation", USUAL) for way in ways
        ):
            return ways[0]
        factor *= RAISED
    return None


def _hangs(own: Setting) -> Iterator[Hang]:
    """Yield the lowest rate for a usual K_x at both ends of each entry's range, as multiples of that without it."""
    middle = slowest_clock(own, USUAL, search=False)
    for entry in ENTRIES if math.isfinite(middle) else ():
        ends = range_of(own.robot, entry)
        low, high = (slowest_clock(at_shares(own, {entry: e}), USUAL, search=False) / middle for e in ends)
        sourced = "in a range" if entry in own.robot.ranges else "from a source"
        yield Hang(entry, ends, (low, high), "assumed" if own.robot.assumed(entry) else sourced)
