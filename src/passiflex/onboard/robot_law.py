"""One period on a robot, as one pure function of flat vectors: what it says in, the torque that it is told out.

Around the period of a simulation, `PeriodLaw`, there is no more than what a robot leaves open: readings that are
missing, and what is watched. Python, the guard and the exported C run this function; a simulation runs `PeriodLaw`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from passiflex.layout import Field, Layout, Signal
from passiflex.loops.period_law import PeriodLaw
from passiflex.loops.period_row import PeriodRow
from passiflex.onboard.approach import Near, approach_layout, approach_state, approached
from passiflex.onboard.readings import SAID, completed, robot_layout, said_layout
from passiflex.onboard.watch import AT_ONCE, Watched, watch_layout, watch_state, watched
from passiflex.parts import Parts
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.controller import LARGEST_READING, SampledController
from passiflex.sampled.motors import limited
from passiflex.sampled.rest import Rest
from passiflex.sampled.said import said_state
from passiflex.sampled.sensors import AbstractSensorEffect
from passiflex.sampled.tank import finite


@dataclass(frozen=True, eq=False)
class RobotLaw:
    """(said, setpoint, memory, p) → (memory, torque, signals)."""

    controller: SampledController
    effects: tuple[AbstractSensorEffect, ...] = ()

    @cached_property
    def period(self) -> PeriodLaw:
        """Return the period of a simulation."""
        return PeriodLaw(self.controller, self.effects, senses=False)

    @property
    def robot(self) -> FlexibleJointRobot:
        """Return the robot."""
        return self.controller.law.robot

    @cached_property
    def said(self) -> Layout:
        """Return what the robot says in a period."""
        return said_layout(self.robot)

    @cached_property
    def setpoint(self) -> Layout:
        """Return what is asked for."""
        n, k, across = self.robot.n, self.controller.law.task.size, ("axis", "column")
        return Layout(
            (
                Field("position", (3,), "m", "x_d", axes=("axis",)),
                Field("rotation", (3, 3), "1", "axes of x_d, as columns", axes=across),
                Field("velocity", (6,), "m/s, rad/s", "ẋ_d", axes=("component",)),
                Field("acceleration", (6,), "m/s^2, rad/s^2", "ẍ_d", axes=("component",)),
                Field("stiffness", (k, k), "N/m, N, N m/rad", "K_x", axes=("task_row", "task_column")),
                Field("damping", (k, k), "N s/m, N s, N m s/rad", "D_x", axes=("task_row", "task_column")),
                Field("wrench", (6,), "N, N m", "that the end effector is to exert", axes=("component",)),
                Field("posture", (n,), "rad", "toward which the self-motion is drawn"),
                Field("fresh", (), "1", "1 if it is new"),
                Field("run", (), "1", "0 stops softly"),
            )
        )

    @cached_property
    def parameters(self) -> Parts:
        """Return the layouts of its numbers."""
        own = {"robot": robot_layout(self.robot.n), "watch": watch_layout(), "approach": approach_layout()}
        return Parts({**self.period.parameters.layouts, **own})

    @cached_property
    def memory(self) -> Layout:
        """Return its state: that of the period, of the readings, of the watch."""
        return self.period.memory + self._own

    @cached_property
    def _own(self) -> Layout:
        """Return what is remembered around the period."""
        around = said_state(self.robot.n) + watch_state(self.said.size - 1)
        return around + approach_state(self.controller.law.task.size)

    @cached_property
    def signals(self) -> Layout:
        """Return what it says of a period."""
        return Layout.of(self._symbols[1])

    @cached_property
    def function(self) -> cs.Function:
        """Return (said, setpoint, memory, p) → (memory, torque, signals)."""
        inputs, signals, after, torque = self._symbols
        out = [after, torque, self.signals.stack_of(signals)]
        names = ["said", "setpoint", "memory", "p"], ["after", "torque", "signals"]
        return cs.Function("robot_law", list(inputs), [cs.densify(v) for v in out], *names, {"cse": True})

    @cached_property
    def begin(self) -> cs.Function:
        """Return (said, level, p) → (memory, setpoint, measurement) of a robot that stands still.

        Its reference is where the Cartesian spring is slack, its tank at a level [J]; the motors give what the robot
        says, or what carries the weight that the law knows of.
        """
        (said, y), level = self.said.symbols("said"), cs.SX.sym("level")
        p = cs.SX.sym("p", self.parameters.size)
        views, law, n = self.parameters.view(p), self.controller.law, self.robot.n
        model, gains, fresh = views["model"], views["gains"], said_state(n)
        before = fresh.view(cs.SX.zeros(fresh.size))
        heard = completed(y, self.robot, model, views["robot"], before, cs.SX.zeros(n)).measured.q
        carried = self.robot.arm.gravity_torque(heard, model)
        command = cs.if_else(views["robot"].says_applied > 0, y.applied, carried)
        measured = completed(y, self.robot, model, views["robot"], before, command).measured
        home = law.stored(measured, model, gains).pose
        scale = cs.if_else(views["watch"].soft_start > AT_ONCE, 0, 1)
        at = {
            "position": home.position,
            "rotation": home.rotation,
            "stiffness": scale * gains.stiffness,
            "level": level,
            "command": command,
        }
        own = {f.name: cs.SX.zeros(*f.shape) for f in self._own} | {
            "scale": scale,
            "near_position": home.position,
            "near_rotation": home.rotation,
            "near_stiffness": gains.stiffness,
            "near_damping": gains.damping,
        }
        memory = cs.vertcat(self._first(at), self._own.stack(own))
        asked = {f.name: cs.SX.zeros(*f.shape) for f in self.setpoint} | {
            "position": home.position,
            "rotation": home.rotation,
            "stiffness": gains.stiffness,
            "damping": gains.damping,
            "posture": views["actions"].posture,
            "fresh": 1,
            "run": 1,
        }
        out = [memory, self.setpoint.stack(asked), self.period.measurement.stack(measured._asdict())]
        names = ["said", "level", "p"], ["memory", "setpoint", "measurement"]
        return cs.Function(
            "robot_begin", [said, level, p], [cs.densify(v) for v in out], *names, {"cse": True}
        )

    def _first(self, at: dict[str, cs.SX]) -> cs.SX:
        """Return the memory of the period before it has read anything: each of its numbers is one of where it begins.

        Each part of a loop says in numbers what it remembers at rest (`Rest`); what of it is which is found by asking.
        """
        n, k = self.robot.n, self.controller.law.task.size
        shapes = {"position": (3,), "rotation": (3, 3), "stiffness": (k, k), "level": (), "command": (n,)}
        where = Layout(tuple(Field(name, shape, "") for name, shape in shapes.items()))

        def memory(flat: NDArray[np.float64]) -> NDArray[np.float64]:
            v, still = where.unpack(flat), np.zeros(n)
            rest = Rest(
                0.0, still, still, still, still, v["command"], np.ones(n), v["position"], v["rotation"],
                v["stiffness"], float(v["level"]),
            )  # fmt: skip
            return self.period.start(rest)

        none = memory(np.zeros(where.size))
        columns = [memory(row) - none for row in np.eye(where.size)]
        return cs.DM(none) + cs.sparsify(cs.DM(np.array(columns).T)) @ where.stack(at)

    @cached_property
    def _symbols(self) -> tuple[tuple[cs.SX, ...], tuple[Signal, ...], cs.SX, cs.SX]:
        said, y = self.said.symbols("said")
        setpoint, w = self.setpoint.symbols("setpoint")
        memory, s = self.memory.symbols("memory")
        p = cs.SX.sym("p", self.parameters.size)
        views = self.parameters.view(p)
        robot, model = self.robot, views["model"]
        says = self._says(views["robot"])
        raw = said[: self.said.size - 1]
        heard = cs.if_else(says > 0, raw, 0)
        ok = cs.logic_and(finite(heard, y.elapsed, below=LARGEST_READING), y.elapsed > 0)
        passed = cs.if_else(ok > 0, y.elapsed, self._nominal(views))
        applied = cs.if_else(views["robot"].says_applied * ok > 0, y.applied, s.applied_torque)
        full = completed(y, robot, model, views["robot"], s, applied)
        watch = watched(heard, passed, ok, w, s, views["watch"], says)
        views["actions"] = SimpleNamespace(**{**vars(views["actions"]), "posture": w.posture})
        own = self.period.memory.size
        begun = cs.vertcat(memory[: own - robot.n], applied)
        at = SimpleNamespace(**{**vars(s), "applied_torque": applied})
        measured = full.measured._replace(q=cs.if_else(ok > 0, full.measured.q, math.nan))
        near = approached(w, watch.age, passed, s, views["approach"])
        result = self.period.step(measured, begun, at, self._told(near, w.wrench, passed, watch), views)
        torque = cs.if_else(ok > 0, result.applied, self._faded(watch.scale, at, views, passed))
        kept = cs.if_else(ok > 0, full.state, memory[own : own + full.state.numel()])
        senses = self.period.sensors.state.size
        read = cs.if_else(ok > 0, result.after[:senses], memory[:senses])
        after = cs.vertcat(read, result.after[senses : own - robot.n], torque, kept, watch.state, near.state)
        return (said, setpoint, memory, p), self._signals(result.signals, full, watch), after, torque

    def _says(self, g: Any) -> cs.SX:
        """Return 1 for each number that the robot says, flat as its readings without the time."""
        return cs.vertcat(
            *(cs.repmat(getattr(g, f"says_{name}"), self.said.slices[name].stop - self.said.slices[name].start, 1)
              for name in SAID)
        )  # fmt: skip

    def _told(self, w: Near, wrench: cs.SX, elapsed: cs.SX, watch: Watched) -> Any:
        """Return the row of the period."""
        n = self.robot.n
        moves = cs.if_else(watch.fresh, 1, 0)
        row = {
            "desired_position": w.position,
            "desired_rotation": w.rotation,
            "desired_velocity": moves * w.velocity,
            "desired_acceleration": moves * w.acceleration,
            "desired_stiffness": watch.scale * w.stiffness,
            "desired_damping": w.damping,
            "feedforward": watch.scale * wrench,
            "torque_noise": cs.SX.zeros(n),
            "link_noise": cs.SX.zeros(n),
            "motor_noise": cs.SX.zeros(n),
            "elapsed": elapsed,
        }
        task = self.controller.law.task
        told = PeriodRow(n, task.size, Layout(()), task.turned, self.controller.readings.noisy).told
        return SimpleNamespace(**{f.name: row[f.name] for f in told})

    def _nominal(self, views: Any) -> cs.SX:
        """Return the time that a period lasts where nobody says how long it was."""
        return cs.SX(views["errors"].period)

    def _faded(self, scale: cs.SX, at: Any, views: Any, elapsed: cs.SX) -> cs.SX:
        """Return the torque where nothing is read: it fades with σ, to what carries the arm where it was seen last."""
        q = cs.if_else(at.heard > 0, at.heard_q, at.last_q)
        carried = self.robot.arm.gravity_torque(q, views["model"])
        limits = views["limits"]
        return limited(
            carried + scale * (at.last_command - carried),
            at.applied_torque,
            limits.torque_limit,
            limits.torque_rate_limit,
            elapsed,
        )

    def _signals(self, of_period: tuple[Signal, ...], full: Any, watch: Any) -> tuple[Signal, ...]:
        torque = self.robot.arm.chain.joint_units[2]
        return (
            *of_period,
            Signal(Field("stiffness_scale", (), "1", "σ of the watch"), watch.scale),
            Signal(
                Field("carried_weight", (self.robot.n,), torque, "taken out of the readings"), full.weight
            ),
        )
