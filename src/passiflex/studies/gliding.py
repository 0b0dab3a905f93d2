"""A hand that glides round a dome, in closed form: its press, its lag, and how long a tank pays for it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from passiflex.control.posture import posture
from passiflex.simulation import Scenario, resolve

Array = NDArray[np.float64]

DOME, HAND, GAP, LEAN = 0.15, 0.02, 0.01, math.radians(30)
"""Radius of dome and hand, their distance at the start [m], and how far the circle is from the dome's top [rad]."""
SPEED = 0.1
"""Of the hand along the dome [m/s]."""
STIFFNESS, DAMPING, SURFACE = 1000.0, 80.0, 1e4
"""K_x and D_x in all directions, and the dome's stiffness [N/m, N s/m, N/m]."""
TANK, FLOOR = 5.0, 0.1
"""Level at the start, and below which nothing is granted [J]."""


class Steady(NamedTuple):
    """A hand that glides round the dome, in closed form.

    Attributes
    ----------
    force: Along the normal [N].
    lag: Of the hand behind the reference, along the circle [m].
    stored: In the Cartesian spring [J].
    power: Lost to friction [W]: μ f v.
    """

    force: float
    lag: float
    stored: float
    power: float

    @property
    def lasts(self) -> float:
        """Return how long the tank pays for it [s], if nothing is held back for the sensors' errors."""
        return (TANK - FLOOR - self.stored) / self.power


class Carried(NamedTuple):
    """What moves with the hand, evened out over the turn of a circle about z: (3, 3) each.

    Attributes
    ----------
    inertia: Λ of links and shaped motors [kg].
    softness: What the joints give way, J K⁻¹ Jᵀ [m/N].
    """

    inertia: Array
    softness: Array


def carried(scenario: Scenario) -> Carried:
    """Return what moves with the hand where a scenario starts."""
    problem = resolve(scenario)
    robot, gains = problem.law.robot, problem.law.layout.unpack(problem.gains)
    at = posture(robot, problem.q, robot.layout.unpack(problem.plant))
    moving, J = at.mass_matrix + np.diag(gains["shaped_inertia"]), at.jacobian
    inertia = np.linalg.inv(J @ np.linalg.solve(moving, J.T))[:3, :3]
    return Carried(_even(inertia), _even(J[:3] @ (J[:3] / robot.joint_stiffness).T))


def _even(matrix: Array) -> Array:
    level = (matrix[0, 0] + matrix[1, 1]) / 2
    return np.diag([level, level, matrix[2, 2]])


def steady(force: float, friction: float, hand: Carried) -> Steady:
    """Return the closed form: K_x (x_d − x − C F) − D_x v = Λ a + F, F = −f n + μ f t, the hand on the dome."""
    depth = force * (1 / STIFFNESS + 1 / SURFACE)
    wanted = (DOME + HAND - depth) * np.array([math.sin(LEAN), 0, math.cos(LEAN)])
    glides = SPEED / ((DOME + HAND) * math.sin(LEAN))

    def balance(unknown: Array) -> tuple[Array, Array, float]:
        f, lean, behind = unknown
        normal = np.array(
            [math.sin(lean) * math.cos(behind), -math.sin(lean) * math.sin(behind), math.cos(lean)]
        )
        along = np.array([math.sin(behind), math.cos(behind), 0])
        radius = DOME + HAND - f / SURFACE
        speed = glides * radius * math.sin(lean)
        exerted = -f * normal + friction * f * along
        stretch = wanted - radius * normal - hand.softness @ exerted
        inward = -(glides**2) * radius * normal * (1, 1, 0)
        left = STIFFNESS * stretch - DAMPING * speed * along - hand.inertia @ inward - exerted
        return left, stretch, speed

    def rest(unknown: Array) -> Array:
        return balance(unknown)[0]

    found = root(rest, np.array([force, LEAN, 0.1]))
    assert found.success, found.message
    _, stretch, speed = balance(found.x)
    f, lean, behind = found.x
    radius = (DOME + HAND) * math.sin(lean)
    return Steady(
        float(f),
        radius * float(behind),
        STIFFNESS * float(stretch @ stretch) / 2,
        friction * float(f) * speed,
    )
