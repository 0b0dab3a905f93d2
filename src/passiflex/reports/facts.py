"""What was run, in words: robot, law, gains, rate, tank, sensors, motors, noise, from the resolved configuration."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
import yaml

from passiflex.reports.surroundings import surroundings
from passiflex.sampled.tanks import TANKS
from passiflex.scenarios.gain_settings import (
    Damping,
    ShapedInertia,
    ShapedStiffness,
    Stiffness,
    TargetInertia,
)
from passiflex.scenarios.law_settings import ImpedanceSettings
from passiflex.scenarios.sensor_settings import DELAYS, SensorSettings
from passiflex.simulation import Run, Scenario, passed_limits
from passiflex.texts.yaml_tree import RefusedText, Tree

Facts = list[tuple[str, str]]
GRAVITY = {
    "robot": "carried by the robot itself",
    "motor": "compensated at the motor position",
    "static": "compensated exactly at rest",
    "model": "cancelled by the law's model",
}
RELATIVE = ("joint_stiffness", "joint_damping", "motor_inertia", "link_inertia")


def facts(run: Run, scenario: Scenario | None) -> Facts:
    """Return label and value of each fact; from the run's attributes alone without one."""
    attributes = run.data.attrs
    found: Facts = [("robot", _robot(run))]
    if scenario is None:
        found += [("law", str(attributes["law"]))] if "law" in attributes else []
        period = float(attributes["control_period"])
        found.append(("control", f"{_hertz(1 / period)}" if period else "continuous time"))
        found.append(("tank", "yes" if run.has_tank else "none"))
    else:
        found[:0] = [("task", scenario.description)] if scenario.description else []
        found += _law(scenario)
        found.append(("control", _control(scenario)))
        found.append(("tank", _tank(scenario)))
        found += _world(scenario)
        found += surroundings(scenario)
    found.append(("duration", _duration(run)))
    found += [("moved by", run.engine)] if run.moved_elsewhere else []
    found += [("limit passed", str(passed)) for passed in passed_limits(run)]
    found += [("seed", str(attributes["seed"]))] if "seed" in attributes else []
    return found


def made_by(run: Run) -> str:
    """Return version and commit that made the run."""
    version, commit = (str(run.data.attrs.get(name, "unknown")) for name in ("version", "commit"))
    changed = " with changes" if commit.endswith("+") else ""
    return f"passiflex {version}, commit {commit[:7] if commit != 'unknown' else commit}{changed}"


def shown_configuration(run: Run) -> str:
    """Return the resolved configuration, with a robot file by its name: where it lies is nobody else's business."""
    text = str(run.data.attrs["scenario"])
    tree = Tree()
    try:
        robot = tree.read(text, "a configuration names a robot").get("robot")
    except RefusedText:
        if "robot" not in text:
            return text
        return re.sub(r"(?<![^\s'\"])[^\s'\"]*[/\\]", "", text)  # nobody can say which of it is the path
    name = re.split(r"[/\\]", robot)[-1] if isinstance(robot, str) else robot
    if name == robot:
        return text
    there = tree.spans["robot",]
    return text[: there.start] + yaml.safe_dump(name).splitlines()[0] + text[there.stop :]


def _robot(run: Run) -> str:
    joints = run.data.sizes.get("joint", 0)
    name = str(run.data.attrs.get("robot", "unknown"))
    return f"{name}, {joints} joint{'s' * (joints != 1)}" if joints else name


def _law(scenario: Scenario) -> Facts:
    law = scenario.law
    found = [("law", f"{law.title}, task {law.task}"), ("gravity", GRAVITY[law.gravity])]
    found.append(("stiffness K_x", _gains(law.stiffness, "N/m", "N m/rad")))
    found.append(("damping D_x", _gains(law.damping, "N s/m", "N m s/rad")))
    if isinstance(law, ImpedanceSettings):
        found.append(("shaped stiffness K_e", _shaped(law.shaped_stiffness, "K", "N m/rad")))
        found.append(("shaped inertia B_e", _shaped(law.shaped_inertia, "B", "kg m²")))
    else:
        found.append(("target inertia M_x", _gains(law.target_inertia, "kg", "kg m²")))
        found.append(("motor inertia", law.motor_inertia))
    return found


def _control(scenario: Scenario) -> str:
    control = scenario.control
    if control is None:
        return "continuous time"
    late = f"commands {_seconds(control.delay)} late" if control.delay else "no delay"
    parts = [_hertz(control.rate), late]
    parts += (
        [f"the task at {_hertz(control.task_rate)}"] if control.task_rate and control.task_periods > 1 else []
    )
    parts += [f"jitter up to {_seconds(control.jitter)}"] if control.jitter else []
    parts += [f"{control.missed:.3g} of the periods missed"] if control.missed else []
    parts += [f"{sum(b.periods for b in control.lost)} lost in bursts"] if control.lost else []
    return ", ".join([*parts, f"{control.inner_loop} inner loop", f"τ_e: {control.external_torque}"])


def _tank(scenario: Scenario) -> str:
    tank = scenario.tank
    if tank is None:
        return "none"
    parts = [TANKS[tank.kind or "paper"].title, f"{tank.initial:g} J at the start", f"T_min {tank.floor:g} J"]
    parts += [f"cap {tank.cap:g} J"] if np.isfinite(tank.cap) else []
    parts += [f"filled by {tank.fill:.3g} of the dissipation"] if tank.fill != 1 else []
    parts += [f"at most {tank.power:g} W"] if np.isfinite(tank.power) else []
    return ", ".join([*parts, f"{tank.accounting} accounting"])


def _world(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield what is not ideal: tool, sensors, motors, noise, and how far robot and model are off."""
    tool = scenario.tool
    if any(tool.position) or any(tool.rotation_vector):
        turned = f", turned by {_list(tool.rotation_vector)} rad" if any(tool.rotation_vector) else ""
        yield "tool", f"{_list(tool.position)} m{turned}"
    sensors = scenario.sensors
    if sensors is not None:
        yield (
            "sensors",
            f"q {_resolution(sensors.link_resolution)}, θ {_resolution(sensors.motor_resolution)}, "
            f"velocities: {sensors.velocity}" + "".join(_late(sensors)),
        )
    motors = scenario.motors
    if motors is not None:
        limit = "torques not limited" if motors.torque_limit == "none" else "torques limited"
        rubbing = np.any(motors.coulomb_friction) or np.any(motors.viscous_friction)
        sticks = " that sticks" * (motors.friction == "sticks" and bool(np.any(motors.coulomb_friction)))
        yield "motors", f"{limit}, {'with' if rubbing else 'no'} friction{sticks}"
    actions = scenario.actions
    if actions is not None and actions.compensates:
        dry, viscous = (
            f"{np.max(most):g}" for most in (actions.coulomb_compensation, actions.viscous_compensation)
        )
        yield "friction made up for", f"up to {dry} N m and {viscous} N m s/rad, as the valve is open"
    noise = scenario.noise
    if noise is not None and (noise.torque_variance or not (noise.link_deviation or noise.motor_deviation)):
        yield (
            "noise of τ_a",
            f"variance {noise.torque_variance:g} (N m)², each value held for {_seconds(noise.hold)}",
        )
    if noise is not None and (noise.link_deviation or noise.motor_deviation):
        yield (
            "noise of q, θ",
            f"deviations {noise.link_deviation:g} and {noise.motor_deviation:g} rad, new in each period",
        )
    for label, relative in (
        ("robot is off by", scenario.deviations),
        ("model is off by", scenario.model_errors),
    ):
        off = [
            f"{name.replace('_', ' ')} {_percent(getattr(relative, name))}"
            for name in RELATIVE
            if np.any(getattr(relative, name))
        ]
        if off:
            yield label, ", ".join(off)


def _duration(run: Run) -> str:
    wanted, end = float(run.data.attrs.get("duration", 0.0)), float(run.time[-1])
    return f"{wanted:g} s" if not run.failure else f"{end:.4g} s of {wanted:g} s: {run.failure}"


def _gains(gains: Stiffness | Damping | TargetInertia, unit: str, turning: str) -> str:
    """Return a matrix of the task as short as its form allows."""
    ratio = getattr(gains, gains.alternative) if gains.alternative else None
    if ratio is not None:
        return f"damping ratio {ratio:g}"
    full = gains.full()
    blocks = [(full[:3, :3], unit)] + ([(full[3:, 3:], turning)] if len(full) == 6 else [])
    coupled = " (with coupling)" if len(full) == 6 and full[:3, 3:].any() else ""
    return ", ".join(f"{_block(block)} {unit}" for block, unit in blocks) + coupled


def _block(block: np.ndarray) -> str:
    diagonal = np.diag(block)
    if np.any(block != np.diag(diagonal)):
        return "[" + "; ".join(" ".join(f"{x:.4g}" for x in row) for row in block) + "]"
    return f"{diagonal[0]:.4g}" if np.ptp(diagonal) == 0 else _list(diagonal)


def _shaped(shaped: ShapedStiffness | ShapedInertia, own: str, unit: str) -> str:
    if shaped.ratio is not None:
        return f"{_list(shaped.ratio)} × {own}"
    assert shaped.value is not None
    return f"{_list(shaped.value)} {unit}"


def _list(values: float | Sequence[float] | np.ndarray) -> str:
    numbers = np.ravel(values)
    return f"{numbers[0]:.4g}" if numbers.size == 1 else "[" + ", ".join(f"{x:.4g}" for x in numbers) + "]"


def _resolution(angle: float) -> str:
    return f"to {angle * 1000:.3g} mrad" if angle else "exact"


def _percent(values: float | Sequence[float]) -> str:
    return ", ".join(f"{x:+.3g} %" for x in 100 * np.ravel(values))


def _hertz(rate: float) -> str:
    return f"{rate / 1000:g} kHz" if rate >= 1000 else f"{rate:g} Hz"


def _seconds(time: float) -> str:
    return f"{time * 1000:.4g} ms" if time < 1 else f"{time:.4g} s"


def _late(sensors: SensorSettings) -> Iterator[str]:
    """Yield which sensors are late, and by how much."""
    for symbol, entry in zip(("q", "θ", "τ_a", "F_e"), DELAYS, strict=True):
        if late := getattr(sensors, entry):
            yield f", {symbol} {_seconds(late)} late"
