"""What a run records, by name: of a sample, the same for a run alone and for runs in lanes; and all that any may."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache

from passiflex.control.law import ImpedanceLaw
from passiflex.errors import ValueRangeError
from passiflex.layout import Field, Layout
from passiflex.loops.closed_loop import ClosedLoop
from passiflex.loops.plant import ELEMENTS
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.controller import SampledController
from passiflex.sampled.external import MomentumObserver
from passiflex.sampled.matched_loop import MatchedInnerLoop
from passiflex.sampled.tanks import PortTank


def sample_parts(loop: SampledLoop) -> dict[str, Layout]:
    """Return the parts of one sample, in their order, by the names of `LaneLoop.instant`."""
    robot = loop.controller.law.robot
    n, (_, _, torque) = robot.n, robot.arm.chain.joint_units
    parts = {
        "x": loop.plant.state,
        "quads": energies(loop.plant.energies),
        "controller": loop.memory,
        "command": Layout((Field("tau_m", (n,), torque, "motor torque in force"),)),
        "signals": loop.signals,
        "truth": loop.truth,
        "row": loop.row,
    }
    require_distinct([*parts.values(), loop.witness.extremes])
    return parts


def instant_parts(loop: ClosedLoop) -> tuple[Layout, Layout, Layout]:
    """Return state, energies and outputs of a loop in continuous time, as a run has them."""
    parts = loop.state, energies(loop.energies), loop.output_layout
    require_distinct([*parts, loop.witness.extremes])
    return parts


def require_distinct(parts: Sequence[Layout]) -> None:
    """Refuse two signals of one name in a run, of which one would be lost: an element may be called as it likes.

    Raises
    ------
    ValueRangeError
        With the names.
    """
    names = Counter(f.name for layout in parts for f in layout.kept)
    if twice := [name for name, count in names.items() if count > 1]:
        needs = "another name of what was brought: an entry of environment, a class, a field"
        raise ValueRangeError("a run has two signals of one name", got=", ".join(twice), needs=needs)


@cache
def axes_of_signals() -> dict[str, tuple[str, ...]]:
    """Return the axes of every signal that a run over time may have, after that of time."""
    law = ImpedanceLaw(FlexibleJointRobot.load("planar2r"))
    everything = SampledController(law, PortTank(), MomentumObserver(), MatchedInnerLoop(), compensates=True)
    continuous = instant_parts(ClosedLoop(law, ELEMENTS))
    layouts = [*sample_parts(SampledLoop(everything)).values(), *continuous]
    return {f.name: f.dims for layout in layouts for f in layout.kept}


def energies(powers: Layout) -> Layout:
    """Return the energies that powers add up to, as a run has them."""
    return Layout(tuple(f._replace(name=f"{f.name}_energy") for f in powers))
