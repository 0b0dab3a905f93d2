"""The sampled loop as one matrix: a joint by hand, the loop itself over some periods, exact derivatives, theory §4."""

from __future__ import annotations

from functools import lru_cache

import casadi as cs
import numpy as np
import pytest
import scipy.linalg
import yaml

from passiflex.errors import ValueRangeError
from passiflex.problems.problem import SampledProblem
from passiflex.robots import FlexibleJointRobot
from passiflex.robots.arm import SerialArm
from passiflex.robots.chain import Body, Joint, SerialChain
from passiflex.simulation import Problem, parse_scenario, resolve
from passiflex.simulation.simulate_sampled import longest_step, start
from passiflex.stability.driven_loop import driven
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.loop_at_rest import loop_at_rest
from passiflex.studies import shipped_scenario
from worlds import merged, world

K, D, B, MASS, ARM, INERTIA, LENGTH = 4000.0, 3.0, 0.4, 2.0, 0.3, 0.05, 0.7
K_X, D_X, PERIOD = 300.0, 15.0, 1e-3


def one_joint() -> FlexibleJointRobot:
    """Return a link that turns about y, its end effector on its own x axis."""
    joint = Joint("j", "revolute", np.zeros(3), np.zeros(3), np.array([0.0, 1, 0]), -3, 3, 2.0, 50.0)
    body = Body(MASS, np.array([ARM, 0, 0]), np.array([0.01, 0, 0, INERTIA, 0, 0.05]))
    chain = SerialChain("one", (joint,), (body,), np.array([LENGTH, 0, 0]), np.eye(3))
    numbers = {"joint_stiffness": K, "joint_damping": D, "motor_inertia": B, "torque_limit": 50.0}
    return FlexibleJointRobot(
        name="one",
        arm=SerialArm(chain),
        velocity_limit=np.full(1, 2.0),
        position_limit=np.array([[-3.0, 3.0]]),
        **{name: np.full(1, value) for name, value in numbers.items()},
    )


def one_joint_loop(K_e: float, B_e: float, delay: float) -> LinearLoop:
    law = {
        "shaped_stiffness": [K_e],
        "shaped_inertia": [B_e],
        "stiffness": {"translation": K_X},
        "damping": {"translation": D_X},
    }
    control = {"rate": 1 / PERIOD, "delay": delay}
    scenario = world(posture=[0.3], law=law, control=control, reference=[])
    return LinearLoop(resolve(scenario, one_joint()))


def by_hand(K_e: float, B_e: float, delay: float) -> np.ndarray:
    """Return the eigenvalues of one joint under the law that makes φ = q + K/K_e (θ − q) obey B_e φ̈ = τ_u − τ_a.

    From φ̈ = q̈ + K/K_e (θ̈ − q̈), θ̈ = (τ_m − τ_a)/B and q̈ = τ_a/M:  τ_m = τ_a + B [q̈ + K_e/K ((τ_u − τ_a)/B_e − q̈)].
    """
    M = INERTIA + MASS * ARM**2
    A_c, B_c = np.zeros((4, 4)), np.array([[0], [0], [0], [1 / B]])
    A_c[:2, 2:] = np.eye(2)
    tau_a = np.array([-K, K, -D, D])
    A_c[2], A_c[3] = tau_a / M, -tau_a / B
    phi = np.array([1 - K / K_e, K / K_e, 0, 0])
    dphi = np.roll(phi, 2)
    tau_u = -(LENGTH**2) * (K_X * phi + D_X * dphi)
    ddq = tau_a / M
    law = (tau_a + B * (ddq + K_e / K * ((tau_u - tau_a) / B_e - ddq)))[None]

    def held(time: float) -> tuple[np.ndarray, np.ndarray]:
        whole = scipy.linalg.expm(np.block([[A_c, B_c], [np.zeros((1, 5))]]) * time)
        return whole[:4, :4], whole[:4, 4:]

    periods = round(delay / PERIOD, 9)
    whole, part = int(periods), (periods - int(periods)) * PERIOD
    late = whole + (part > 0)
    # z = (x, τ of the period before, of the one before that, …); the older command is in force first.
    out = np.zeros((4 + late, 4 + late))
    told = [np.hstack([law, np.zeros((1, late))])] + [np.eye(1, 4 + late, 4 + i) for i in range(late)]
    (early, g_early), (rest, g_rest) = held(part), held(PERIOD - part)
    out[:4, :4] = rest @ early
    out[:4] += rest @ g_early @ told[late] + g_rest @ told[whole]
    for i in range(late):
        out[4 + i] = told[i]
    return np.linalg.eigvals(out)


@pytest.mark.parametrize("delay", [0.0, 0.5e-3, 1e-3, 1.5e-3, 40.5e-3])
@pytest.mark.parametrize(("K_ratio", "B_ratio"), [(1, 0.5), (1, 0.03), (0.4, 0.1), (5, 0.2)])
def test_one_joint_has_the_eigenvalues_worked_out_by_hand(
    K_ratio: float, B_ratio: float, delay: float
) -> None:
    """Up to the 1e-8 of central differences and its square root where two eigenvalues are close."""
    loop = one_joint_loop(K_ratio * K, B_ratio * B, delay)
    ours, theirs = np.linalg.eigvals(loop.matrix()), by_hand(K_ratio * K, B_ratio * B, delay)
    for value in theirs[np.abs(theirs) > 0.01]:
        assert np.abs(ours - value).min() < 1e-5 * max(1, abs(value))
    assert loop.radius() == pytest.approx(np.abs(theirs).max(), rel=1e-6)


CASES = [
    pytest.param({"delay": late * PERIOD, "inner_loop": inner, "external_torque": how}, id=f"{inner} {late}")
    for inner, how, late in (
        ("plain", "true", 0), ("plain", "observer", 1), ("plain", "true", 1.5), ("matched", "none", 1),
        ("matched", "none", 2.3),
    )
]  # fmt: skip
SENSORS = {"velocity": "differences", "velocity_filter": 200, "torque_bandwidth": 500}


def planar(control: dict[str, object], **changes: object) -> Problem:
    return resolve(
        world(control=control, law={"gravity": "static"}, reference=[], sensors=SENSORS, **changes)
    )


@pytest.mark.parametrize("control", CASES)
def test_the_matrix_is_the_derivative_of_the_loop_itself(control: dict[str, object]) -> None:
    """The nonlinear loop through four periods, from what is a little off rest, by central differences.

    With a sixteenth of the step that a run takes, Runge-Kutta is off by 1e-7 per period, the derivative by 1e-8
    of a row's largest number; rows of torques are some 1e4 of those of angles, which the powers pick up.
    """
    p = planar(control)
    loop, periods = LinearLoop(p), 4
    assert isinstance(p, SampledProblem)
    s, held = p, loop.compiled.held
    at_rest = loop_at_rest(p, loop.compiled.loop, p.law.layout.unpack(p.gains), s.period)
    timing = np.tile([s.delay, 1.0], (periods + 1, 1))
    longest = longest_step(p, loop.compiled.plant) / 16
    first = start(p, loop.compiled)._replace(controller=at_rest.memory)

    def run(z: np.ndarray) -> np.ndarray:
        memory = at_rest.memory.copy()
        memory[loop.remembered] = z[loop.x.size :]
        begin = first._replace(x=z[: loop.x.size], controller=memory)
        rows = np.tile(at_rest.row, (periods + 1, 1))
        done = held.advance(begin, rows, timing, s.plant, s.numbers, s.period, longest, last=True)
        return np.hstack([done.x[1:], done.controller[:-1, loop.remembered]])

    z = np.concatenate([loop.x, at_rest.memory[loop.remembered]])
    np.testing.assert_allclose(run(z), np.tile(z, (periods, 1)), atol=1e-9 * np.abs(z).max())
    h, A = 1e-5, loop.matrix()
    slopes = np.array([(run(z + h * e) - run(z - h * e)) / (2 * h) for e in np.eye(z.size)])
    power = np.eye(len(A))
    for k in range(periods):
        power = A @ power
        expected = power[: z.size, : z.size]
        scale = np.abs(expected).max(axis=1, keepdims=True) + 1e-9
        assert (np.abs(slopes[:, k].T - expected) / scale).max() < (1e-6 if k == 0 else 1e-5)


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_central_differences_agree_with_exact_derivatives(inner: str) -> None:
    p = planar({"inner_loop": inner, "delay": PERIOD})
    loop = LinearLoop(p)
    gains = p.law.layout.unpack(p.gains)
    symbolic = loop.compiled.loop.control
    memory, row, _ = loop_at_rest(p, loop.compiled.loop, gains, PERIOD)
    x, c, w, number = (cs.SX.sym(f"v{i}", symbolic.size1_in(i)) for i in range(4))
    after, command, _ = symbolic(x, c, w, number)
    told = loop.compiled.loop.row.slices["torque_noise"]
    slopes = cs.jacobian(cs.vertcat(after, command), cs.vertcat(x, c, w[told]))
    doubtful = (
        memory.copy()
    )  # √0, in the bound of the books, has no derivative; nothing of it reaches the command
    doubtful[loop.compiled.loop.memory.slices["walk"]] = 1.0
    exact = np.array(
        cs.Function("exact", [x, c, w, number], [slopes])(loop.x, doubtful, row, loop.law.numbers)
    )
    n_c = memory.size
    columns = np.concatenate([np.arange(8), 8 + loop.remembered, 8 + n_c + np.arange(2)])
    kept = exact[np.concatenate([loop.remembered, n_c + np.arange(2)])][:, columns]
    ours = loop._control(PERIOD, PERIOD, {}, noise=True, due=True)
    scale = np.maximum(np.abs(kept).max(axis=1, keepdims=True), 1)
    assert (np.abs(ours - kept) / scale).max() < 1e-7


@lru_cache
def iiwa(stiffness: float, inertia: float, **law: float) -> LinearLoop:
    data = yaml.safe_load(shipped_scenario("fig1").to_yaml())
    shaping = {"shaped_stiffness": {"ratio": stiffness}, "shaped_inertia": {"ratio": inertia}}
    changes = {
        "control": {"rate": 1000, "external_torque": "true"},
        "law": shaping | law,
        "tank": {"kind": "port"},
        "reference": [],
        "forces": [],
        "output_interval": 1e-3,
    }
    return LinearLoop(resolve(parse_scenario(yaml.safe_dump(merged(data, changes)))))


def test_the_papers_gains_need_40_kilohertz() -> None:
    """Theory note 4, checked there on the iiwa, without delay."""
    loop = iiwa(10, 0.01)
    stable = [loop.radius(1 / rate, 0.0) < 1 for rate in (1e3, 3e3, 1e4, 2e4, 4e4)]
    assert stable == [False, False, False, False, True]
    assert loop.radius(1e-3, 0.0) > 5


def test_what_1_kilohertz_bears_with_the_joints_own_stiffness() -> None:
    """Theory note 4, and the research behind the matched loop: 0.05 B without delay, 0.15 B with a period of it."""
    loop = iiwa(1, 0.05)
    own = loop.problem.law.robot.motor_inertia

    def stable(ratio: float, delay: float) -> bool:
        return loop.radius(1e-3, delay, {"shaped_inertia": ratio * own}) < 1

    assert [stable(0.05, 0), stable(0.04, 0), stable(0.15, 1e-3), stable(0.1, 1e-3)] == [
        True,
        False,
        True,
        False,
    ]


def test_a_self_motion_drifts_twice_undamped_once_damped_and_not_at_all_where_there_is_none() -> None:
    assert iiwa(1, 0.3, null_space_damping=0.0).spectrum().drifting == 2
    assert iiwa(1, 0.3).spectrum().drifting == 1
    assert LinearLoop(planar({})).spectrum().drifting == 0


def test_the_dominant_mode_names_joint_frequency_and_decay() -> None:
    """One joint: the eigenvalue by hand. The rate of decay is −ln |λ| / T, the frequency arg λ / 2π T."""
    loop = one_joint_loop(K, 0.03 * B, PERIOD)
    values = by_hand(K, 0.03 * B, PERIOD)
    worst, found = values[np.argmax(np.abs(values))], loop.spectrum()
    assert found.joint == 1
    assert not found.stable
    assert found.radius == pytest.approx(loop.radius(), rel=1e-12)
    assert found.decay == pytest.approx(-np.log(abs(worst)) / PERIOD, rel=1e-5)
    assert found.frequency == pytest.approx(abs(np.angle(worst)) / (2 * np.pi * PERIOD), rel=1e-5)


def test_noise_enters_the_command_as_the_joint_torque_does() -> None:
    """K_e = K: τ_m = τ_a + B/B_e (τ_u − τ_a), so that noise on τ_a comes through with 1 − B/B_e."""
    loop = one_joint_loop(K, 0.2 * B, PERIOD)
    (found,) = driven(loop)
    assert found.D.item() == pytest.approx(1 - 1 / 0.2, rel=1e-8)
    np.testing.assert_array_equal(found.A, loop.matrix())
    np.testing.assert_array_equal(found.G[:4], 0)  # the command is a period late, and waits in the last row
    np.testing.assert_array_equal(found.G[-1:], found.D)
    np.testing.assert_array_equal(found.A[-1:], found.C)


def test_limits_resolution_and_friction_are_left_out() -> None:
    motors = {"torque_limit": "robot", "torque_rate_limit": 1e3, "coulomb_friction": 3.0}
    coarse = SENSORS | {"link_resolution": 1e-3, "motor_resolution": 1e-4}
    rough = world(law={"gravity": "static"}, reference=[], sensors=coarse, motors=motors)
    np.testing.assert_array_equal(LinearLoop(resolve(rough)).matrix(), LinearLoop(planar({})).matrix())


def test_a_problem_in_continuous_time_has_no_such_matrix() -> None:
    with pytest.raises(ValueRangeError, match="has no control rate"):
        LinearLoop(resolve(world(control=None, tank=None)))


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_nothing_else_that_is_remembered_acts_back(inner: str) -> None:
    """While the tank is full: a new memory that acts on the command must say so."""
    problem = resolve(world(control={"inner_loop": inner, "external_torque": "observer", "delay": PERIOD}))
    loop = LinearLoop(problem)
    gains = loop.parts["gains"].unpack(problem.gains)
    memory, row, _ = loop_at_rest(problem, loop.compiled.loop, gains, PERIOD)
    layout, control = loop.compiled.loop.memory, loop.compiled.control
    _, command, _ = control(loop.x, memory, row, loop.law.numbers)
    acting = []
    for f in layout:
        moved = memory.copy()
        moved[layout.slices[f.name]] += 1e-6
        _, other, _ = control(loop.x, moved, row, loop.law.numbers)
        if np.abs(other - command).max() > 1e-9:
            acting.append(f.name)
    assert set(acting) <= {f.name for f in layout if f.acts}
    assert bool({"seen_theta", "in_flight"} & set(acting)) == (inner == "matched")
