"""What a run records, by name: of a sample, the same for a run alone and for runs in lanes; and all that any may."""

from __future__ import annotations

from functools import cache

from passiflex.control.law import ImpedanceLaw
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
    return {
        "x": loop.plant.state,
        "quads": energies(loop.plant.energies),
        "controller": loop.memory,
        "command": Layout((Field("tau_m", (n,), torque, "motor torque in force"),)),
        "signals": loop.signals,
        "truth": loop.truth,
        "row": loop.row,
    }


@cache
def axes_of_signals() -> dict[str, tuple[str, ...]]:
    """Return the axes of every signal that a run over time may have, after that of time."""
    law = ImpedanceLaw(FlexibleJointRobot.load("planar2r"))
    everything = SampledController(law, PortTank(), MomentumObserver(), MatchedInnerLoop())
    continuous = ClosedLoop(law, ELEMENTS)
    layouts = [*sample_parts(SampledLoop(everything)).values(), continuous.state, continuous.output_layout]
    layouts.append(energies(continuous.energies))
    return {f.name: f.dims for layout in layouts for f in layout.kept}


def energies(powers: Layout) -> Layout:
    """Return the energies that powers add up to, as a run has them."""
    return Layout(tuple(f._replace(name=f"{f.name}_energy") for f in powers))
