"""All periods of a robot in memory, and a run of them that is audited and shown as one that was simulated."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.errors import SimulationError
from passiflex.loops.recorded import sample_parts
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.native import NativeFunction, compile_functions
from passiflex.onboard.robot_law import RobotLaw
from passiflex.problems.problem import SampledProblem
from passiflex.runs.run import AS_READ, Recorded, Run, assemble

Array = NDArray[np.float64]

ASKED = {
    "desired_position": "position",
    "desired_rotation": "rotation",
    "desired_velocity": "velocity",
    "desired_acceleration": "acceleration",
    "desired_stiffness": "stiffness",
    "desired_damping": "damping",
    "feedforward": "wrench",
}
"""Entry of a period's row → that of a setpoint."""


class Recorder:
    """Room for so many periods, taken one after the other without another allocation; what comes then is left out.

    Attributes
    ----------
    felt: Whether the robot measures the wrench on its end effector.
    count, left_out: Periods that were kept, and that found no room.
    """

    def __init__(self, law: RobotLaw, problem: SampledProblem, periods: int, *, felt: bool):
        self.law, self.problem, self.felt = law, problem, felt
        sizes = (law.said.size, law.setpoint.size, law.memory.size, law.robot.n, law.signals.size)
        self.count, self.left_out = 0, 0
        self._parts = tuple(np.empty((periods, size)) for size in sizes)

    def take(self, *row: Array) -> None:
        """Keep the arrays of one period."""
        if self.count == len(self._parts[0]):
            self.left_out += 1
            return
        for part, values in zip(self._parts, row, strict=True):
            part[self.count] = values
        self.count += 1

    def run(self) -> Run:
        """Return what was recorded, as a run.

        Where the robot is, is what the law read. The energy that came from outside is that of the measured wrench; of
        a robot that has none, what the links' balance leaves for it, which then proves nothing.

        Raises
        ------
        SimulationError
            If nothing was.
        """
        if self.count < 2:
            raise SimulationError("nothing was recorded", got=f"{self.count} periods", needs="two")
        said, setpoint, memory, command, signals = (part[: self.count] for part in self._parts)
        problem, loop = self.problem, SampledLoop(self.problem.controller, self.problem.elements)
        parts = sample_parts(loop)
        heard, told = self.law.said.unpack(said), self.law.signals.unpack(signals)
        time: Array = np.cumsum(heard["elapsed"][:, None].ravel()) - heard["elapsed"].ravel()[0]
        x = self._where(loop, told)
        rows = self._rows(loop, heard, setpoint)
        controller = self._remembered(loop, memory)
        own = {f.name for f in loop.signals}
        z = np.hstack([signals[:, self.law.signals.slices[f.name]] for f in loop.signals if f.name in own])
        felt = rows[:, : loop.plant.environment.size]
        truth, quads, watched = self._judged(loop, time, x, command, felt, controller, z, told)
        numbers = [x, quads, controller, command, z, truth, rows]
        recorded = [
            Recorded(layout.kept, part[:, layout.columns(lambda f: f.kept)])
            for layout, part in zip(parts.values(), numbers, strict=True)
        ]
        whole = dataclasses.replace(problem, duration=float(time[-1]), output_interval=problem.period)
        return assemble(whole, time, recorded, [], "", loop.witness.noted(watched), AS_READ)

    def _where(self, loop: SampledLoop, told: dict[str, Array]) -> Array:
        """Return the state that the readings show, row by row."""
        x = np.zeros((self.count, loop.plant.state.size))
        for name in ("q", "theta", "dq", "dtheta"):
            x[:, loop.plant.state.slices[name]] = told[f"measured_{name}"]
        return x

    def _remembered(self, loop: SampledLoop, memory: Array) -> Array:
        """Return the memory as a simulation has it; what simulated sensors keep back is 0."""
        found = np.zeros((self.count, loop.memory.size))
        for f in loop.memory:
            if f.name in self.law.memory.slices:
                found[:, loop.memory.slices[f.name]] = memory[:, self.law.memory.slices[f.name]]
        return found

    def _rows(self, loop: SampledLoop, heard: dict[str, Array], setpoint: Array) -> Array:
        asked, at = self.law.setpoint.slices, loop.row.slices
        rows = np.zeros((self.count, loop.row.size))
        for name, of in ASKED.items():
            rows[:, at[name]] = setpoint[:, asked[of]]
        rows[:, at["elapsed"]] = heard["elapsed"].reshape(-1, 1)
        rows[:, at["F_e"]] = heard["F_e"] if self.felt else 0.0
        return rows

    def _judged(
        self,
        loop: SampledLoop,
        time: Array,
        x: Array,
        command: Array,
        felt: Array,
        c: Array,
        z: Array,
        told: Any,
    ) -> tuple[Array, Array, Array]:
        """Return what is true by the readings, the energies that passed the ports, and what a witness noted."""
        problem = self.problem
        functions = [loop.outputs, loop.plant.rhs, loop.watch[0]]
        library = compile_functions(functions)
        outputs, plant, look = (NativeFunction(f, library) for f in functions)
        truth = np.asarray(outputs.map(x, command, felt, problem.numbers), dtype=float)
        _, powers = plant.map(x, np.hstack([command, felt]), problem.plant)
        quads = _summed(time, np.asarray(powers))
        q, tau_a = told["measured_q"], told["measured_tau_a"]
        at, true = loop.plant.energies.slices, loop.truth.unpack(truth)
        passed = np.einsum("ij,ij->i", (tau_a[1:] + tau_a[:-1]) / 2, np.diff(q, axis=0))
        quads[1:, at["joint"]] = np.cumsum(passed)[:, None]
        if not self.felt:
            stored = true["link_kinetic_energy"] + true["potential_energy"]
            quads[:, at["external"]] = (stored - stored[0] - quads[:, at["joint"]].ravel())[:, None]
        witness = loop.witness
        p = np.concatenate([problem.numbers, witness.numbers(problem.law.robot, problem.tank.initial)])
        w, y = np.zeros(witness.memory.size), np.hstack([x, quads])
        for i, t in enumerate(time):
            w = np.asarray(look(w, t, y[i], command[i], c[i], z[i], p))
        return truth, quads, w


def _summed(time: Array, powers: Array) -> Array:
    """Return the energies of powers (N, k), by the trapezoid, from 0 on."""
    steps = (powers[1:] + powers[:-1]) / 2 * np.diff(time)[:, None]
    return np.vstack([np.zeros(powers.shape[1]), np.cumsum(steps, axis=0)])
