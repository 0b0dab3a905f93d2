"""The same problem with another rate, delay, gains or plant: everything that hangs on them goes along."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from passiflex.control.motion import rebased
from passiflex.control.posture import posture
from passiflex.errors import NameUnknownError, ValueRangeError
from passiflex.problems.problem import FROM_THE_START, Problem, SampledProblem, require_sampled
from passiflex.problems.sampling import late_errors, late_sensors
from passiflex.sampled.readings import Lateness, Readings
from passiflex.scenarios.control_settings import MOST_PERIODS, MOST_PREDICTED
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.scenario_file import parse_scenario
from passiflex.scenarios.sensor_settings import DELAYS, MOST_LATE
from passiflex.texts.yaml_tree import read_back

Array = NDArray[np.float64]

HIGHEST_RATE = 1e6
"""[Hz], as in a scenario."""
MATRICES = ("stiffness", "damping", "target_inertia")
GAINS = (*MATRICES, "shaped_stiffness", "shaped_inertia", "null_space_damping", "regularisation")
"""Gains that a scenario can write as numbers, and that can therefore be altered."""
SECTIONS = ("law", "control", "fallback", "sensors", "motors", "tank", "actions")
"""Of a scenario; what is written of one leaves the rest of it as it is."""
DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""The one in C takes a tenth of the time."""


def altered(
    problem: Problem,
    *,
    rate: float | None = None,
    delay: float | None = None,
    gains: Mapping[str, ArrayLike] | None = None,
    plant: Mapping[str, ArrayLike] | None = None,
    lateness: Lateness | None = None,
) -> SampledProblem:
    """Return the sampled problem with what is given in place of its own; what is left out stays.

    The inner loop predicts over the new delay, the noise is held for as many periods, the arm rests under its new
    weight, the reference begins where the end effector now is, and the configuration says so.

    Parameters
    ----------
    rate, delay: [Hz], [s].
    gains: Of `law.layout`, by name; those of `GAINS`.
    plant: Of `robot.layout`, by name. The law's model stays as it is.
    lateness: Of the sensors [s].

    Raises
    ------
    ValueRangeError, NameUnknownError, SizeError
        For a problem in continuous time, a rate or delay that makes no sense, gains or numbers that do not fit.
    """
    s, law = require_sampled(problem), problem.law
    most = MOST_PREDICTED if s.controller.inner.predicts else MOST_PERIODS
    period, late = require_timing(s.period, s.delay, rate, delay, most)
    own = law.layout.unpack(s.gains)
    for name in gains or {}:
        if name not in own or name not in GAINS:
            raise NameUnknownError("gain", name, [g for g in GAINS if g in own])
    new = {name: np.asarray(value, dtype=float) for name, value in (gains or {}).items()}
    own |= new
    law.layout.pack(own)
    true = s.parts.unpack("plant", s.numbers) | {k: np.asarray(v, float) for k, v in (plant or {}).items()}
    s.parts["plant"].pack(true)
    data = read_back(s.text)
    if rate is not None or delay is not None:
        _write_timing(data, period, late, rate)
    if gains is not None:
        _write_gains(data["law"], own)
    if lateness is not None:
        data["sensors"] = _late(data.get("sensors"), lateness)
    if plant is not None:
        data["robot"] = f"{law.robot.name}, changed in memory"
    kept = data["control"].get("fallback", {})
    late_by = s.lateness if lateness is None else lateness
    lag, noisy = late_by.in_periods(period), s.controller.readings.noisy
    require_soon(lag)
    fallback = {k: v for k, v in new.items() if k not in kept and not _is_shaping(k)}
    changed = dataclasses.replace(
        s,
        output_interval=float(data["output_interval"]),
        text=_text(data),
        controller=dataclasses.replace(
            s.controller,
            inner=s.controller.inner.expecting(round(late / period)),
            readings=Readings.of(lag, noisy=noisy),
        ),
        period=period,
        delay=late,
        lateness=late_by,
    )
    if {"stiffness", "damping"} & new.keys():  # in world axes, in place of what the law has in tool axes
        later = tuple(c for c in s.gain_changes if c.start > FROM_THE_START)
        changed = dataclasses.replace(changed, gain_changes=later)
    for part, values in (("gains", own), ("fallback", fallback), ("plant", true)):
        changed = changed.with_numbers(values, part)
    for part in ("inner", "errors"):
        changed = changed.with_numbers({"period": period}, part)
    changed = changed.with_numbers(late_errors(lag), "errors").with_numbers(late_sensors(lag), "sensors")
    if s.noise is not None:
        noise = s.noise._replace(hold=_held(s.noise.hold, s.period) * period)
        changed = dataclasses.replace(changed, noise=noise).with_numbers({"noise_hold": noise.hold}, "errors")
    return changed if gains is None and plant is None else _at_rest(changed, true)


def at_rate(scenario: Scenario, rate: float | None = None, delay: float | None = None) -> Scenario:
    """Return the scenario sampled at a rate [Hz] and delay [s], its own unless given.

    Raises
    ------
    ValueRangeError
        If neither the scenario nor the caller says a rate, or one of the two makes no sense.
    """
    control = scenario.control
    if control is None and rate is None:
        raise ValueRangeError(
            f"scenario {scenario.name!r} has no control rate",
            needs="`control: {rate: …}`, or a rate beside it",
            try_="--rate '1 kHz', or rate=1000",
        )
    own = (1 / control.rate, control.delay) if control else (math.nan, 0.0)
    period, late = require_timing(*own, rate, delay)
    data = read_back(scenario.to_yaml())
    _write_timing(data, period, late, rate)
    return parse_scenario(_text(data), source=f"scenario {scenario.name!r}")


def rewritten(text: str, entry: Mapping[str, Any]) -> str:
    """Return a scenario's text with other entries: sections are completed, whatever is in them is replaced whole."""

    def merged(old: Any, new: Mapping[str, Any]) -> dict[str, Any]:
        out = dict(old or {})
        for name, value in new.items():
            out[name] = merged(out.get(name), value) if name in SECTIONS else value
        return out

    return _text(merged(read_back(text), entry))


def with_flange(problem: SampledProblem, inertia: float) -> SampledProblem:
    """Return the problem with this much more inertia [kg m^2] about every axis of the last link, known to the law."""
    for part in ("plant", "model"):
        tensors = problem.parts.unpack(part, problem.numbers)["link_inertia"].copy()
        tensors[-1, [0, 3, 5]] += inertia
        problem = problem.with_numbers({"link_inertia": tensors}, part)
    return problem


def require_timing(
    period: float, own_delay: float, rate: float | None, delay: float | None, most: int = MOST_PERIODS
) -> tuple[float, float]:
    """Return period and delay [s]: the first two, or what is given in their place; of so many periods at most.

    Raises
    ------
    ValueRangeError
        For what is no rate, or no delay that a loop at this rate can have.
    """
    if rate is not None and not 0 < rate <= HIGHEST_RATE:
        raise ValueRangeError(
            "control rate", got=f"{rate:g} Hz", needs=f"above 0, at most {HIGHEST_RATE:g} Hz"
        )
    period = period if rate is None else 1 / rate
    late = own_delay if delay is None else delay
    if not 0 <= late <= most * period * (1 + 1e-9):
        raise ValueRangeError(
            "delay of a command",
            got=f"{late:g} s",
            needs=f"0 to {most} periods, {most * period:g} s at this rate",
        )
    return period, late


def require_soon(late: Lateness) -> None:
    """Raise ValueRangeError for sensors that are too many periods late."""
    if max(late) > MOST_LATE * (1 + 1e-9):
        raise ValueRangeError(
            "delay of a sensor", got=f"{max(late):.4g} periods", needs=f"at most {MOST_LATE} periods"
        )


def later_sensors(problem: SampledProblem, lateness: Lateness) -> SampledProblem:
    """Return the problem with sensors that are so late [s]."""
    lag, controller = lateness.in_periods(problem.period), problem.controller
    require_soon(lag)
    data = read_back(problem.text)
    data["sensors"] = _late(data.get("sensors"), lateness)
    readings = Readings.of(lag, noisy=controller.readings.noisy)
    changed = dataclasses.replace(
        problem,
        lateness=lateness,
        text=_text(data),
        controller=dataclasses.replace(controller, readings=readings),
    )
    return changed.with_numbers(late_errors(lag), "errors").with_numbers(late_sensors(lag), "sensors")


def _late(sensors: Mapping[str, Any] | None, lateness: Lateness) -> dict[str, Any]:
    """Return the entries of the sensors, so late [s]."""
    return dict(sensors or {}) | dict(zip(DELAYS, map(float, lateness), strict=True))


def _is_shaping(name: str) -> bool:
    """Return whether the fallback has a value of its own for this gain, whatever the law's."""
    return name.startswith("shaped_")


def _at_rest(problem: SampledProblem, plant: dict[str, Array]) -> SampledProblem:
    """Return the problem with motors, reference and held torque as they are at rest."""
    law, q = problem.law, problem.q
    weight = posture(law.robot, q, plant).gravity_torque
    stretch = weight / plant["joint_stiffness"]
    model, gains = law.robot.layout.unpack(problem.model), law.layout.unpack(problem.gains)
    K = model["joint_stiffness"]
    shaped = law.posture_at_rest(q, q + stretch, K, gains)
    home = posture(law.robot, shaped, model).pose
    events = (
        e if e.motion is None else e._replace(motion=rebased(e.motion, problem.home, home))
        for e in problem.events
    )
    return dataclasses.replace(
        problem,
        theta=q + stretch,
        home=home,
        events=tuple(events),
        held=weight,
    )


def _write_timing(data: dict[str, Any], period: float, delay: float, rate: float | None) -> None:
    control = data.setdefault("control", {})
    if data.get("noise"):  # a scenario in continuous time gets a sample in each period
        own = 1 / control["rate"] if "rate" in control else data["noise"]["hold"]
        data["noise"]["hold"] = float(_held(data["noise"]["hold"], own) * period)
    control["delay"] = float(delay)
    if rate is not None:
        if "task_rate" in control:  # runs as many periods apart
            control["task_rate"] *= float(rate) / control["rate"]
        control["rate"] = float(rate)
    data["output_interval"] = float(max(1, round(data["output_interval"] / period)) * period)


def _held(hold: float, period: float) -> int:
    """Return for how many periods a sample of the noise is held."""
    return round(hold / period)


def _write_gains(law: dict[str, Any], gains: dict[str, Array]) -> None:
    for name in GAINS:
        if name in gains:
            value = gains[name].tolist()
            law[name] = {"matrix": value} if name in MATRICES else value


def _text(data: dict[str, Any]) -> str:
    return str(
        yaml.dump(
            data, Dumper=DUMPER, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
        )
    )
