"""A law on a robot: what the robot says in, the torque that it is told out, once per period."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from passiflex.errors import SimulationError, SizeError, ValueRangeError
from passiflex.native import NativeFunction, compile_functions
from passiflex.onboard.laid_out import alone, for_robot, laid_out
from passiflex.onboard.readings import SAID
from passiflex.onboard.recorder import Recorder
from passiflex.onboard.report import Report, reasons
from passiflex.onboard.robot_law import RobotLaw
from passiflex.onboard.robot_numbers import robot_numbers
from passiflex.onboard.sensed import Sensed
from passiflex.onboard.setpoint import Setpoint
from passiflex.onboard.settings import ApproachSettings, WatchSettings
from passiflex.sampled.said import SaysLess
from passiflex.sampled.sayable import SAYABLE
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.scenario_file import load_scenario
from passiflex.stability.judgement import Judgement, judge

Array = NDArray[np.float64]

SHARES = ("reference_share", "stiffness_share", "valve")
"""Signals of a period that a report has."""


class Controller:
    """The law of a scenario, stepped period by period.

        controller = pf.Controller("arm.yaml")
        controller.start(pf.Sensed(q=q, dq=dq, tau_a=tau_J))
        while True:
            torque = controller.step(pf.Sensed(q=q, dq=dq, tau_a=tau_J), pf.Setpoint(position=x), elapsed)

    It runs the very function of a simulation. Torque limits and rate limits are inside: what it returns can be sent.

    Parameters
    ----------
    scenario: Or its file; it has a `control` section. What is around the robot in it, and its reference, are left out.
    watch: What is done about setpoints and readings that stay away.
    approach: How a setpoint that jumps is gone over to; at once if it is left out, as far as the tank pays.
    weight_in_readings: Whether torque and motor positions contain the weight although the law does not carry it; left
        out, they do if the robot carries it (`gravity: robot`), as on real arms.

    Attributes
    ----------
    torque: What the last step returned (n,) N m.
    asked: What is asked for, by the names of a setpoint, to be read; `ask` writes it.
    inputs: The numbers that the law was told last, flat: `said` by the robot, and its own `numbers`.
    recorder: What keeps the periods, if anything does.

    Raises
    ------
    UnstableLoopError
        If the loop is unstable at its rate and delay, and the scenario does not allow_unstable.
    ValueRangeError
        For a scenario in continuous time, or one whose law is told the true external torque.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        watch: WatchSettings | None = None,
        approach: ApproachSettings | None = None,
        *,
        weight_in_readings: bool | None = None,
    ):
        read = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self.scenario = self._laid_out = alone(read)
        self.watch, self.approach = watch or WatchSettings(), approach or ApproachSettings()
        self._weight_in_readings = weight_in_readings
        self.problem = laid_out(self.scenario)
        own = tuple(e for e in self.problem.effects if not isinstance(e, SaysLess))
        self.law = RobotLaw(self.problem.controller, own)
        functions = [self.law.function, self.law.begin]
        self._step, self._begin = (
            NativeFunction(f, library) for library in [compile_functions(functions)] for f in functions
        )
        self._said, self._setpoint, self._memory, self._numbers = self._step.inputs
        self._after, torque, self._signals = self._step.outputs
        self.torque: Array = torque.view()
        self.torque.flags.writeable = False
        self._started = False
        self._heard: list[tuple[int, Array]] = []
        self._elapsed = self._said[self.law.said.slices["elapsed"]]
        self.asked = self.law.setpoint.unpack(self._setpoint)
        self.inputs: dict[str, Array] = {"said": self._said, "numbers": self._numbers}
        self._fresh, self._run = (self._setpoint[self.law.setpoint.slices[name]] for name in ("fresh", "run"))
        self.last: Setpoint | None = None
        self.recorder: Recorder | None = None
        self._judgement: Judgement | None = None

    @property
    def period(self) -> float:
        """Return how long a period is meant to last [s]."""
        return self.problem.period

    @property
    def judgement(self) -> Judgement:
        """Return whether the loop is stable where the robot started, and how near to it."""
        if self._judgement is None:
            self._judgement = judge(self.problem)
        return self._judgement

    def start(self, sensed: Sensed, level: float | None = None) -> None:
        """Begin where the robot stands: the reference there, the tank at its initial level unless another is given [J].

        What the robot says now it is to say in every period. If that is less, or it stands elsewhere, than the scenario
        says, the law is laid out anew for it, and judged.

        Raises
        ------
        UnstableLoopError
            As when it was made.
        SizeError, ValueRangeError
            For readings that are too few, of another size, or not finite.
        """
        self._started, self.recorder = False, None
        says = self._hear(sensed)
        full = self.problem.tank.initial if level is None else level
        q = self._begun(sensed, says, full)
        told = [name for name in SAYABLE if says[f"says_{name}"]]
        wanted = for_robot(self._laid_out, self.problem, q, told)
        if wanted is not self._laid_out:
            self.problem, self._laid_out, self._judgement = laid_out(wanted), wanted, None
            self._begun(sensed, says, self.problem.tank.initial if level is None else level)
        self._started = True

    def reset_at(self, sensed: Sensed, level: float | None = None) -> None:
        """Begin anew where the robot stands, as after a reflex, with the tank as it is unless a level is given [J]."""
        self.start(sensed, self.report.level if level is None and self.problem.law.has_tank else level)

    def step(self, sensed: Sensed, setpoint: Setpoint | None = None, elapsed: float | None = None) -> Array:
        """Return the torque that the motors are to give (n,) N m, in an array that the next step overwrites.

        Parameters
        ----------
        setpoint: None if there is no new one.
        elapsed: Time since the last step [s]; the period if it is left out.
        """
        if not self._started:
            raise SimulationError("the controller was not started", try_="controller.start(sensed) before")
        try:
            for i, into in self._heard:
                into[:] = sensed[i]
        except ValueError as error:
            raise SizeError("readings", got=str(error), needs=f"{self.problem.law.robot.n} joints") from error
        self._elapsed[0] = self.problem.period if elapsed is None else elapsed
        if setpoint is not None:
            if setpoint is not self.last:
                self.ask(setpoint)
            self._fresh[0] = 1.0
        elif self.last is not None:
            self._fresh[0] = 0.0
        self._step.call()
        if self.recorder is not None:
            self.recorder.take(self._said, self._setpoint, self._after, self.torque, self._signals)
        self._memory[:] = self._after
        return self.torque

    def stop(self) -> None:
        """Let the arm go softly, within `soften` of the watch; `stopped` then."""
        self._run[0] = 0.0

    def resume(self) -> None:
        """Take the arm again, within `soft_start`."""
        self._run[0] = 1.0

    @property
    def stopped(self) -> bool:
        """Return whether the stiffness is gone after `stop`."""
        return not self._run[0] and not self._value("scale")

    @property
    def state(self) -> Array:
        """Return all that it remembers, to be kept or moved elsewhere."""
        return self._memory.copy()

    @state.setter
    def state(self, memory: ArrayLike) -> None:
        given = np.asarray(memory, dtype=float)
        if given.shape != self._memory.shape:
            raise SizeError("state of the controller", got=given.shape, needs=f"shape {self._memory.shape}")
        self._memory[:] = given

    @property
    def report(self) -> Report:
        """Return what became of the last period, and why."""
        told = self.law.signals.slices
        shares = {name: float(self._signals[told[name]][0]) for name in SHARES}
        found = Report(
            level=self._value("tank_energy") if self.problem.law.has_tank else np.nan,
            bound=self._value("measurement_bound"),
            **shares,
            latched=self._value("latched") > 0,
            faults=int(self._value("faults")),
            stiffness_scale=self._value("scale"),
            setpoint_age=self._value("setpoint_age"),
            silent_time=self._value("silent_time"),
            frozen_time=self._value("frozen_time"),
            why="",
        )
        words = reasons(found, self.watch, self.problem.tank.floor, runs=bool(self._run[0]))
        return found._replace(why="; ".join(words))

    def record(self, seconds: float) -> Recorder:
        """Return a recorder of the steps to come, with room for so many seconds, until it is started anew."""
        felt = any(SAID[i] == "F_e" for i, _ in self._heard)
        self.recorder = Recorder(self.law, self.problem, round(seconds / self.period) + 1, felt=felt)
        return self.recorder

    def _value(self, name: str) -> float:
        return float(self._memory[self.law.memory.slices[name]][0])

    def _hear(self, sensed: Sensed) -> dict[str, float]:
        """Note what the robot says; return its numbers by name."""
        says = {name: value is not None for name, value in zip(SAID, sensed, strict=True)}
        if not (says["q"] or says["theta"]):
            raise ValueRangeError(
                "a robot that says neither where its links nor where its motors are", needs="q or theta"
            )
        slices = self.law.said.slices
        self._heard = [(i, self._said[slices[name]]) for i, name in enumerate(SAID) if says[name]]
        return {f"says_{name}": float(said) for name, said in says.items()}

    def _begun(self, sensed: Sensed, says: dict[str, float], level: float) -> Array:
        """Begin with the readings at a level [J] of the tank, and return where the links are (n,)."""
        self._numbers[:] = robot_numbers(
            self.law,
            self.problem,
            says,
            self.watch,
            self.approach,
            weight_in_readings=self._weight_in_readings,
        )
        for i, into in self._heard:
            value = np.asarray(sensed[i], dtype=float)
            if value.shape != into.shape:
                raise SizeError(f"{SAID[i]} of the robot", got=value.shape, needs=f"shape {into.shape}")
            if not np.isfinite(value).all():
                raise ValueRangeError(f"{SAID[i]} of the robot", got=value.tolist(), needs="finite numbers")
            into[:] = value
        self._elapsed[0] = self.problem.period
        memory, setpoint, measured = self._begin(self._said, level, self._numbers)
        self._memory[:], self._setpoint[:] = memory, setpoint
        self._signals[:] = 1.0
        self.last = None
        return self.law.period.measurement.unpack(measured)["q"]

    def ask(self, setpoint: Setpoint) -> None:
        """Write a setpoint, of which what is left out stays."""
        for name, into in self.asked.items():
            value = getattr(setpoint, name, None)
            if value is None:
                if name in ("velocity", "acceleration", "wrench"):
                    into[...] = 0.0
                continue
            if value.shape != into.shape:
                raise SizeError(f"{name} of a setpoint", got=value.shape, needs=f"shape {into.shape}")
            into[...] = value
        self.last = setpoint
