"""What a step of a controller on a robot takes from Python, beside its function alone and a setpoint's checks."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import passiflex as pf

COUNT = 20_000


def median(do: Callable[[], object]) -> tuple[float, float]:
    """Return median and 99th percentile of the time that it takes [µs]."""
    taken = np.empty(COUNT)
    for i in range(COUNT):
        begin = time.perf_counter()
        do()
        taken[i] = time.perf_counter() - begin
    return 1e6 * float(np.median(taken)), 1e6 * float(np.percentile(taken, 99))


def main() -> None:
    """Print the times and their ratios to the function alone."""
    scenario = pf.shipped_scenario("fig1_sampled")
    controller = pf.Controller(scenario.changed({"control.external_torque": "none"}))
    said = pf.Sensed(q=controller.problem.q, dq=np.zeros(7), tau_a=np.zeros(7))
    controller.start(said)
    setpoint = pf.Setpoint(velocity=np.zeros(6))
    gains = np.eye(6) * 100
    ways: dict[str, Callable[[], object]] = {
        "the function alone": controller._step.call,
        "a step, the same setpoint": lambda: controller.step(said, setpoint, 1e-3),
        "a step, none": lambda: controller.step(said, None, 1e-3),
        "a setpoint with K_x and D_x, made": lambda: pf.Setpoint(
            position=[0, 0, 0], rotation=np.eye(3), stiffness=gains, damping=gains
        ),
    }
    found = {name: median(do) for name, do in ways.items()}
    (alone, _) = found["the function alone"]
    for name, (middle, late) in found.items():
        print(f"{name}: {middle:.1f} µs, 99 % below {late:.1f} µs, {middle / alone:.2f} times the function")


if __name__ == "__main__":
    main()
