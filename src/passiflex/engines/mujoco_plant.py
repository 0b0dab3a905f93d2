"""The plant of a sampled loop in MuJoCo, moved step by step under the law's commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.engines.contact import Contact
from passiflex.engines.felt import Felt
from passiflex.engines.mjcf import Options
from passiflex.engines.mujoco_model import NOTHING, mujoco_model, mujoco_module
from passiflex.engines.touching import Touching
from passiflex.loops.moved import NODES, WEIGHTS, MovedLoop
from passiflex.native import NativeFunction
from passiflex.problems.problem import SampledProblem

Array = NDArray[np.float64]


class MujocoPlant:
    """Moves the plant of a problem in MuJoCo, and runs the law on what it is then (`native.python_loop.Mover`).

    The motors' torques and the wrench from outside are actuators. What elements do is added to the passive forces at
    every stage of a step; energies are summed up over the same stages, by the very rule that moved the robot. Sensors
    are positions and velocities of the state itself.
    """

    def __init__(
        self,
        problem: SampledProblem,
        moved: MovedLoop,
        x: Array,
        step: float,
        contacts: Mapping[str, Contact] = NOTHING,
    ):
        self._mujoco = mujoco_module()
        plant = problem.loop.plant
        robot, n = plant.robot, plant.robot.n
        numbers = robot.layout.unpack(problem.plant[: robot.layout.size])
        self.model = mujoco_model(robot, numbers, Options(step, contact=bool(contacts)), contacts)
        self.data = self._mujoco.MjData(self.model)
        self._n, self._n_x, self._own = n, plant.state.size, plant.parameters.size
        self._felt, self._step, self._moved = plant.environment.size, step, moved
        self._where, self._speed, self._told = self.data.qpos, self.data.qvel, self.data.ctrl
        self._passive, self._held = self.data.qfrc_passive, self.data.qfrc_constraint
        self._where[:n], self._where[n : 2 * n] = x[n : 2 * n], x[:n]
        self._speed[:n], self._speed[n : 2 * n] = x[3 * n : 4 * n], x[2 * n : 3 * n]
        self._touching = Touching(self.model, self.data, contacts, plant) if contacts else None
        self._acts = any(e.acts for e in plant.elements if not isinstance(e, Felt))
        self._stages = moved.passed.inputs[0].reshape(len(WEIGHTS), self._n_x)
        self._rates, self._own_state = np.zeros((len(WEIGHTS), self._n_x - 4 * n)), x[4 * n :].copy()
        felt = [plant.state.slices[f.name] for e in plant.elements if isinstance(e, Felt) for f in e.state(n)]
        self._moves = np.setdiff1d(np.arange(4 * n, self._n_x), np.r_[(0, *felt)].astype(int))
        self._stage, self._given = 0, 0.0
        self._due, self._felt_since = 0.0, False
        moved.push.inputs[2][:] = moved.passed.inputs[2][:] = problem.plant

    @property
    def why(self) -> str:
        """Return what MuJoCo warned of; empty while it did not."""
        numbers = self.data.warning.number
        if not numbers.any():
            return ""
        kinds = self._mujoco.mjtWarning
        names = [kinds(i).name.removeprefix("mjWARN_") for i in np.flatnonzero(numbers)]
        return f"MuJoCo warned of {', '.join(names)} {self.data.time:.4g} s after the start"

    def control(self, y: Array, c: Array, row: Array, p: Array) -> tuple[Array, Array, Array]:
        """Return the memory after a period, the command, and the signals."""
        self._feel(y)
        sense, law = self._moved.sense, self._moved.law
        sense.inputs[0][:], sense.inputs[1][:], sense.inputs[2][:] = (
            y[: self._n_x],
            row[: self._felt],
            p[: self._own],
        )
        sense.call()
        law.inputs[0][:], law.inputs[1][:] = sense.outputs[0], c
        law.inputs[2][:], law.inputs[3][:] = row[self._felt :], p[self._own :]
        law.call()
        after, command, signals = law.outputs
        return after, command, signals

    def step(self, y: Array, inputs: Array, p: Array, h: float) -> None:
        """Take one step of MuJoCo's integrator, and sum up what passed the ports meanwhile."""
        n, mujoco, touching, passed = self._n, self._mujoco, self._touching, self._moved.passed
        if h != self._step:
            self.model.opt.timestep = self._step = h
        self._told[:], self._moved.push.inputs[1][:] = inputs[: n + 6], inputs[n:]
        self._stage, self._given = 0, 0.0
        self._in_mujoco(mujoco.mj_step)
        if touching is not None:
            self._touched()
            self._due += h * self._given
            self._felt_since = False
        passed.inputs[1][:], passed.inputs[3][:] = inputs, h
        passed.call()
        self._read(y)
        if self._moves.size:
            self._own_state += h * (np.array(WEIGHTS) @ self._rates)
            y[self._moves] = self._own_state[self._moves - 4 * n]
        y[self._n_x :] += passed.outputs[0]

    def _in_mujoco(self, function: Callable[[Any, Any], None]) -> None:
        """Call one of MuJoCo's functions, with what the elements do; its callbacks are those of a process."""
        mujoco = self._mujoco
        mujoco.set_mju_user_warning(_silent)
        mujoco.set_mjcb_passive(self._staged)
        try:
            function(self.model, self.data)
        finally:
            mujoco.set_mjcb_passive(None)
            mujoco.set_mju_user_warning(None)

    def _feel(self, y: Array) -> None:
        """Write into y what is felt of the contacts now, and what passed them since it was written last."""
        if self._touching is None or self._felt_since:
            return
        if self.data.ncon or not self.data.time:
            self._stage = len(WEIGHTS)
            self._in_mujoco(self._mujoco.mj_forward)
        self._touching.feel(y, self._due)
        self._due, self._felt_since = 0.0, True

    def look(self, w: Array, time: float, y: Array, held: Array, c: Array, z: Array, p: Array) -> Array:
        """Return what the watch remembers after a sample."""
        self._feel(y)
        return _called(self._moved.look, w, time, y, held, c, z, p)

    def glance(self, w: Array, time: float, y: Array, p: Array) -> Array:
        """Return what the watch remembers after a step."""
        return _called(self._moved.glance, w, time, y, p)

    def _read(self, x: Array) -> None:
        n = self._n
        x[:n], x[n : 2 * n] = self._where[n : 2 * n], self._where[:n]
        x[2 * n : 3 * n], x[3 * n : 4 * n] = self._speed[n : 2 * n], self._speed[:n]

    def _staged(self, model: Any, data: Any) -> None:
        """Note a stage, and add what the elements do to MuJoCo's passive forces; their states go along by its rule."""
        n, stage, push = self._n, self._stage, self._moved.push
        within = stage < len(WEIGHTS)
        moving = self._stages[stage] if within else push.inputs[0]
        moving[: 2 * n], moving[2 * n : 4 * n] = self._where, self._speed
        if self._moves.size:
            moving[4 * n :] = self._own_state
            if within and stage:
                moving[4 * n :] += NODES[stage] * self._step * self._rates[stage - 1]
        if within:
            if stage and self._touching is not None:
                self._touched()
            self._stage = stage + 1
        if self._touching is not None and self._touching.crosses:
            self._touching.cross()
        if self._acts:
            push.inputs[0][:] = moving
            push.call()
            self._passive += push.outputs[0]
            if within:
                self._rates[stage] = push.outputs[1]

    def _touched(self) -> None:
        """Add the power of the contacts in the stage before: their forces are known when it has ended."""
        n, before = self._n, self._stage - 1
        self._given += WEIGHTS[before] * float(self._held[n:] @ self._stages[before, 3 * n : 4 * n])


def _silent(text: str) -> None:
    """Hear a warning of MuJoCo, which would write a file of it where one stands; `MujocoPlant.why` says it."""


def _called(function: NativeFunction, *values: Array | float) -> Array:
    """Return the first output, without the checks and copies of a call by arguments."""
    for into, value in zip(function.inputs, values, strict=True):
        into[:] = value
    function.call()
    return function.outputs[0]
