"""Parts of somebody's own, tried once before they are compiled: what is wrong is said of the part and its method."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, get_args

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from passiflex.control.law import AbstractLaw
from passiflex.control.motion import MOTION, Pose
from passiflex.control.signals import Measurement, Reference
from passiflex.elements import AbstractElement, Effect, Port, Touch
from passiflex.errors import PassiflexError, PassiflexWarning, SizeError, ValueRangeError
from passiflex.layout import Layout
from passiflex.loops.plant import given_by
from passiflex.problems.problem import Problem
from passiflex.problems.unbooked import listed
from passiflex.robots.arm import EndEffectorPose
from passiflex.robots.flexible import RobotState
from passiflex.sampled.sensors import AbstractSensorEffect
from passiflex.sampled.tank import AbstractTank, PeriodFlows, TankNumbers
from passiflex.scenarios.reference import AbstractReferenceEvent

Array = NDArray[np.float64]

TRIES = 32
"""States in which a part is looked at."""
SAME = 1e-6
"""Share by which two sums of the same energies may differ."""
SPEED = 0.3
"""How fast the robot moves in them, of its own units."""
OWN_CHANGE = 0.1
"""How far an element's own state is from that at rest, in its units."""
PLACE = 0.05
"""How far joints and reference are from the start, in their units."""
PORTS = get_args(Port)


@contextmanager
def saying(part: object, method: str, needs: str) -> Iterator[None]:
    """Say of whatever goes wrong within that it is the part's own method that fails."""
    try:
        yield
    except PassiflexError:
        raise
    except Exception as error:
        what = f"{type(part).__name__}.{method} fails"
        got = f"{type(error).__name__}: {str(error).strip().splitlines()[-1] if str(error).strip() else ''}"
        raise ValueRangeError(what, got=got, needs=needs) from error


def check_element(element: AbstractElement, n: int) -> None:
    """Raise unless an element's effect is one, at its own port; warn if it gives what it does not have.

    Raises
    ------
    SizeError, ValueRangeError
        For a port that there is not, a name that no signal can have, an effect that is none.
    """
    who = type(element).__name__
    if element.port not in PORTS:
        raise ValueRangeError(
            f"{who}.port", got=repr(element.port), needs=listed([repr(port) for port in PORTS], "or")
        )
    if not element.name.isidentifier():
        needs = "letters, digits and _, as signals are called by it"
        raise ValueRangeError(f"{who}.name", got=repr(element.name), needs=needs)
    if element.inputs().size:
        raise ValueRangeError("an element of one's own has inputs", got=who, needs="attributes of its own")
    symbols, at, m = _touch(element, n)
    with saying(element, "act", "an Effect, made by nothing(n)._replace(...)"):
        effect = element.act(at, Layout(()).view(cs.SX(0, 1)), m)
        effect = Effect(*(cs.SX(part) for part in effect))
    ones = dict.fromkeys(("lost", "stored", "supplied"), 1)
    sizes = {"motor": n, "link": n, "force": 3, "moment": 3, **ones, "rate": element.state(n).size}
    for name, size in sizes.items():
        if (got := getattr(effect, name).numel()) != size:
            raise SizeError(f"{who}.act: {name} of its effect", got=f"{got} numbers", needs=f"{size}")
    at_port = {"motors": ("motor",), "links": ("link",), "end effector": ("force", "moment")}
    elsewhere = {part for parts in at_port.values() for part in parts} - set(at_port[element.port])
    if not all(getattr(effect, part).is_zero() for part in elsewhere):
        needs = f"`port` says where, {listed([repr(port) for port in PORTS], 'or')}: its books are kept there"
        raise ValueRangeError(f"an element touches more than the {element.port}", got=who, needs=needs)
    if not element.stores and not effect.stored.is_zero():
        raise ValueRangeError("an element stores energy", got=who, needs="stores = True, for its books")
    if not element.supplies and not effect.supplied.is_zero():
        raise ValueRangeError("an element is supplied", got=who, needs="supplies = True, for its books")
    _warn_of_gifts(element, n, symbols, at, effect)


def _touch(element: AbstractElement, n: int) -> tuple[list[cs.SX], Touch, Any]:
    """Return the symbols of what may touch a robot: its motion, the element's state, and the parameters."""
    x = RobotState(*(cs.SX.sym(name, n) for name in RobotState._fields))
    velocity, spin, position = (cs.SX.sym(name, 3) for name in ("velocity", "spin", "position"))
    rotation, axes = cs.SX.sym("rotation", 3, 3), cs.SX.sym("axes", 3, 3)
    own_vector, own = element.state(n).symbols("own")
    p, m = element.parameters(n).symbols("m")
    symbols = [*x, velocity, spin, position, rotation, axes, own_vector, p]
    return symbols, Touch(x, velocity, spin, position, rotation, axes, own), m


def _warn_of_gifts(element: AbstractElement, n: int, symbols: list[cs.SX], at: Touch, effect: Effect) -> None:
    """Warn of an element that loses less than nothing, or gives more than it loses from its store.

    What it stores can be followed where it does not depend on velocities, as no acceleration is known.
    """
    given = given_by(effect, at)
    sizes = cs.fabs(effect.lost) + cs.fabs(given) + cs.fabs(effect.supplied)
    left = given + effect.lost + _storing(symbols, effect) - effect.supplied
    f = cs.Function("element", symbols, [effect.lost, left, sizes])
    numbers = element.parameters(n).pack(dict(element.numbers(n)))
    start = element.state(n).pack(dict(element.start(Pose(np.zeros(3), np.eye(3)), n)))
    rng, least, gift = np.random.default_rng(0), 0.0, 0.0
    for _ in range(TRIES):
        moved = [rng.normal(0, SPEED, size=size) for size in (n, n, n, n, 3, 3, 3)]
        turn, axes = (Rotation.random(random_state=rng).as_matrix() for _ in range(2))
        own = start + rng.normal(0, OWN_CHANGE, start.size)
        lost, left, size = (float(v) for v in f(*moved, turn, axes, own, numbers))
        if size > 0 and np.isfinite(lost):
            least = min(least, lost / size)
        if size > 0 and np.isfinite(left):
            gift = max(gift, abs(left) / size)
    wrong = "loses less than nothing: `lost` of its effect is below 0" if least < -SAME else ""
    if not wrong and gift > SAME:
        wrong = "keeps no books: what it gives, loses and stores does not add up to nothing"
    if wrong:
        warnings.warn(f"{type(element).__name__} {wrong}", PassiflexWarning, stacklevel=6)


def _storing(symbols: list[cs.SX], effect: Effect) -> cs.SX:
    """Return the rate of what an element stores [W]; no number where it cannot be followed."""
    q, theta, dq, dtheta, velocity, spin, position, rotation, axes, own, _ = symbols
    if cs.depends_on(effect.stored, cs.vertcat(dq, dtheta, velocity, spin)):
        return cs.SX(cs.nan)
    along = [(q, dq), (theta, dtheta), (position, rotation @ velocity), (rotation, rotation @ cs.skew(spin))]
    along.append((axes, cs.skew(rotation @ spin) @ axes))
    along += [(own, effect.rate)] if own.numel() else []
    return sum((cs.jtimes(effect.stored, place, rate) for place, rate in along), cs.SX(0))


def check_sensor(effect: AbstractSensorEffect, n: int) -> None:
    """Raise SizeError or ValueRangeError unless a sensor effect reads what a reading is, and gives its own state."""
    who, layout = type(effect).__name__, effect.state(n)
    y = _measurement(n)
    with saying(effect, "read", "Reading(y._replace(...), state)"):
        read, state = effect.read(y, cs.SX.sym("elapsed"), layout.symbols("s")[1])
        found = {name: cs.SX(getattr(read, name)).numel() for name in Measurement._fields}
        size = cs.SX(state).numel()
    for name, before in zip(Measurement._fields, y, strict=True):
        if found[name] != before.numel():
            raise SizeError(f"{who}.read: {name}", got=f"{found[name]} numbers", needs=f"{before.numel()}")
    if size != layout.size:
        raise SizeError(f"{who}.read: its state", got=f"{size} numbers", needs=f"{layout.size}")


def check_tank(tank: AbstractTank) -> None:
    """Raise ValueRangeError unless a tank's flow is one number, of what flows in a period."""
    who = type(tank).__name__
    if unknown := [name for name in tank.reads if name not in PeriodFlows._fields]:
        needs = ", ".join(PeriodFlows._fields)
        raise ValueRangeError(f"{who}.reads", got=", ".join(unknown), needs=needs)
    flows = PeriodFlows(*(cs.SX.sym(name) for name in PeriodFlows._fields))
    g: TankNumbers
    vector, g = tank.layout.symbols("g")
    with saying(tank, "flow", "the energy that comes in, one number in J"):
        flow = cs.SX(tank.flow(flows, g))
    if flow.numel() != 1:
        raise SizeError(f"{who}.flow", got=f"{flow.numel()} numbers", needs="one, in J")
    some = cs.Function("flow", [*flows, vector], [flow])(*([0.1] * len(flows)), np.ones(tank.layout.size))
    if not np.isfinite(float(some)):
        raise ValueRangeError(f"{who}.flow", got=float(some), needs="a finite number of J")


def check_motion(event: AbstractReferenceEvent, now: Pose) -> None:
    """Raise unless what an event builds is a motion."""
    with saying(event, "build", f"a motion, with {', '.join(f.name for f in MOTION)}"):
        motion = dict(event.build(now))
    MOTION.pack(motion)


def check_law(law: AbstractLaw, problem: Problem) -> None:
    """Raise unless a law has the gains that loops set, carries the weight that there is, and says one storage.

    Raises
    ------
    ValueRangeError
        If a gain is missing, the plant has weight of which the law knows nothing (or the other way round), its
        command and its `stored` claim two different storages, or one of its methods fails.
    """
    who, k = type(law).__name__, law.task.size
    for name, shape in {"stiffness": (k, k), "damping": (k, k), "regularisation": ()}.items():
        found = [f for f in law.layout if f.name == name and f.shape == shape]
        if not found:
            needs = f'Field("{name}", {shape}, ...): what a loop sets; zeros where a law has none'
            raise ValueRangeError(
                f"{who}.layout lacks a gain", got=", ".join(f.name for f in law.layout), needs=needs
            )
    if law.gravity.in_model != problem.law.gravity.in_model:
        weight = "weight, which the law knows nothing of" if problem.law.gravity.in_model else "no weight"
        raise ValueRangeError(
            f"{who} and the scenario differ in who carries the weight",
            got=f"{type(law.gravity).__name__} in the law; in the scenario the plant has {weight}",
            needs="the same for both",
            try_=f"{type(problem.law.gravity).__name__}() in the law, or another law.gravity in the scenario",
        )


def check_storage(problem: Problem) -> None:
    """Raise ValueRangeError if a law's command claims another storage than its `stored` and `potential`.

    The verdict rests on what was stored at the start: by `stored`; the books at the rows on what the command claims.
    """
    law, n = problem.law, problem.law.robot.n
    y, pose = _measurement(n), EndEffectorPose(cs.SX.sym("x", 3), cs.SX.sym("R", 3, 3))
    model, m = law.robot.layout.symbols("m")
    gains, g = law.layout.symbols("g")
    with saying(law, "command", "a Command, as `control.law.AbstractLaw` says"):
        e = law.command(y, Reference(pose, cs.SX.zeros(6)), m, g).energy
        claimed = e.motor_kinetic + e.joint_spring + e.cartesian_spring + e.gravity_storage
    with saying(law, "stored", "a Stored, as `control.law.AbstractLaw` says"):
        at = law.stored(y, m, g)
        stored = at.energy + law.potential(at, pose, g.stiffness)
    f = cs.Function("storages", [*y, *pose, model, gains], [claimed, stored])
    numbers = [problem.numbers[problem.parts.slices[part]] for part in ("model", "gains")]
    rng, home = np.random.default_rng(0), problem.home
    for _ in range(TRIES):
        q, theta = (v + rng.normal(0, PLACE, n) for v in (problem.q, problem.theta))
        others = [rng.normal(0, SPEED, part.numel()) for part in y[2:]]
        goal = home.position + rng.normal(0, PLACE, 3)
        by_command, by_stored = (float(v) for v in f(q, theta, *others, goal, home.rotation, *numbers))
        if abs(by_command - by_stored) > SAME * max(1.0, abs(by_stored)):
            raise ValueRangeError(
                f"{type(law).__name__} claims two different storages",
                got=f"{by_command:.6g} J by its command, {by_stored:.6g} J by `stored` and `potential`, in one state",
                needs="the same in both, as the verdict and the books rest on them",
                try_="a spring of its own in `stored`; `potential`, if its Cartesian spring is not the task's",
            )


def _measurement(n: int) -> Measurement:
    sizes = {"F_e": 6}
    return Measurement(*(cs.SX.sym(name, sizes.get(name, n)) for name in Measurement._fields))
