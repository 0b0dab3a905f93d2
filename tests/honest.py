"""Whether an element gives nothing of its own: its power, its loss and the rate of its store add up."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace

import casadi as cs
import numpy as np
from scipy.spatial.transform import Rotation

from passiflex.elements import AbstractElement, Touch
from passiflex.layout import Layout

N = 3


def numbers(layout: Layout, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return numbers for a layout: positive ones, axes at right angles, a place and points near the end effector."""
    drawn = {f.name: rng.uniform(0, 5, f.shape) + 1e-2 * f.name.endswith("width") for f in layout}
    near = {f.name: rng.normal(size=f.shape) for f in layout if f.name.endswith(("place", "points"))}
    return drawn | near | {f.name: _turned(rng) for f in layout if f.name.endswith("axes")}


@lru_cache(maxsize=4)
def balancing(element: AbstractElement) -> cs.Function:
    """Return (speeds, places, inputs, parameters) → the power through the port, the loss, the rate of what is stored.

    The rate is the derivative of what is stored along the motion of motors and end effector, and of its own state.
    """
    speeds = {
        name: cs.SX.sym(name, size) for name, size in (("dq", N), ("dtheta", N), ("velocity", 3), ("spin", 3))
    }
    dq, dtheta, velocity, spin = speeds.values()
    own, layout = element.state(N).symbols("own")[0], element.state(N)
    sizes = {"q": (N, 1), "theta": (N, 1), "position": (3, 1), "rotation": (3, 3), "axes": (3, 3)}
    at = {name: cs.SX.sym(name, *size) for name, size in sizes.items()}
    state = SimpleNamespace(q=at["q"], theta=at["theta"], dq=dq, dtheta=dtheta)
    touch = Touch(state, velocity, spin, at["position"], at["rotation"], at["axes"], layout.view(own))
    (inputs, s), (parameters, m) = element.inputs().symbols("s"), element.parameters(N).symbols("m")
    effect = element.act(touch, s, m)
    places = cs.vertcat(*(cs.vec(place) for place in at.values()), own)
    turning, along = at["rotation"] @ cs.skew(spin), cs.skew(at["rotation"] @ spin) @ at["axes"]
    moving = cs.vertcat(dq, dtheta, at["rotation"] @ velocity, cs.vec(turning), cs.vec(along), effect.rate)
    rate = cs.jtimes(effect.stored, places, moving)
    given = cs.dot(effect.motor, dtheta) + cs.dot(effect.link, dq)
    given += cs.dot(effect.force, velocity) + cs.dot(effect.moment, spin) - effect.supplied
    told = [cs.vertcat(*speeds.values()), places, inputs, parameters]
    return cs.Function("balance", told, [given, effect.lost, rate])


def balance(element: AbstractElement, seed: int) -> tuple[float, float, float]:
    """Return the sum of the three in a random state, which is to be 0; the loss; and their size."""
    rng, layouts = np.random.default_rng(seed), (element.parameters(N), element.inputs())
    m, s = (layout.pack(numbers(layout, rng)) for layout in layouts)
    speed = 10 ** rng.uniform(-6, 1)
    speeds = np.concatenate([rng.normal(size=size) * speed for size in (N, N, 3, 3)])
    turned = [_turned(rng).ravel() for _ in range(2)]
    there = np.concatenate([rng.normal(size=2 * N + 3), *turned, rng.normal(size=element.state(N).size)])
    parts = [float(value) for value in balancing(element)(speeds, there, s, m)]
    return sum(parts), parts[1], sum(map(abs, parts))


def _turned(rng: np.random.Generator) -> np.ndarray:
    return Rotation.random(random_state=rng).as_matrix()


def require_honest(element: AbstractElement) -> None:
    for seed in range(200):
        left, lost, size = balance(element, seed)
        assert lost >= 0
        assert abs(left) <= 1e-13 * size
