"""Random flexible-joint robots, gains and states, and the closed loop in the coordinates of the paper."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs
import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from arms import serial_chains
from passiflex.control import AbstractLaw, EnergyTank
from passiflex.control.inner_loop import shaped_motion
from passiflex.control.motion import reference_at
from passiflex.control.tank import NO_CAP
from passiflex.robots.arm import SerialArm
from passiflex.robots.chain import SerialChain
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.simulation import ClosedLoop

GRAVITY = (0.7, -0.4, -9.81)
SEEDS = st.integers(0, 2**32 - 1)


def with_joints(chain: SerialChain, seed: int) -> FlexibleJointRobot:
    """Return a robot of random K (stiff enough to carry any random arm), D and B."""
    rng, n = np.random.default_rng(seed), chain.n
    return FlexibleJointRobot(
        name="random",
        arm=SerialArm(chain),
        joint_stiffness=rng.uniform(2e4, 6e4, n),
        joint_damping=rng.uniform(0.5, 10, n),
        motor_inertia=rng.uniform(0.05, 1.5, n),
        torque_limit=np.full(n, 100.0),
        velocity_limit=np.full(n, 2.0),
        position_limit=np.tile([-3.0, 3.0], (n, 1)),
    )


def robots(
    min_joints: int = 1, max_joints: int = 3, *, prismatic: bool = True
) -> st.SearchStrategy[FlexibleJointRobot]:
    """Return a strategy for random robots."""
    return st.builds(with_joints, serial_chains(min_joints, max_joints, prismatic=prismatic), SEEDS)


def definite(rng: np.random.Generator, size: int, low: float, high: float) -> np.ndarray:
    """Return a symmetric positive definite matrix with eigenvalues between low and high."""
    Q, _ = np.linalg.qr(rng.normal(size=(size, size)))
    A = Q @ np.diag(rng.uniform(low, high, size)) @ Q.T
    return (A + A.T) / 2


def rotation(rng: np.random.Generator) -> np.ndarray:
    """Return a random rotation matrix."""
    return Rotation.random(random_state=rng).as_matrix()


def impedance_gains(law: AbstractLaw, rng: np.random.Generator, **fixed: float) -> dict[str, np.ndarray]:
    """Return random gains of an `ImpedanceLaw`, shaped above or below the real joint."""
    robot, k = law.robot, law.task.size
    return {
        "shaped_stiffness": robot.joint_stiffness * rng.uniform(0.8, 10, robot.n),
        "shaped_inertia": robot.motor_inertia * rng.uniform(0.01, 1.5, robot.n),
        "stiffness": definite(rng, k, 10, 1000),
        "damping": definite(rng, k, 1, 100),
        "null_space_damping": np.asarray(rng.uniform(0, 10)),
        "regularisation": np.asarray(1e-2),
    } | {name: np.asarray(value) for name, value in fixed.items()}


def tank_numbers(fill: float = 1.0, **other: float) -> np.ndarray:
    """Return the parameters of a tank, without a cap and far above its floor unless told."""
    usual = {"fill": fill, "floor": 0.01, "low": 0.05, "cap": NO_CAP, "band": 0.05, "signed": 0.0}
    return EnergyTank().layout.pack({f"tank_{k}": np.asarray(v) for k, v in (usual | other).items()})


def random_motion(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return coefficients of a reference that moves and turns, whatever the clock."""
    return {
        "polynomial": rng.uniform(-0.3, 0.3, (3, 6)),
        "horizon": np.asarray(rng.choice([1e-9, 1e9])),
        "sine": rng.uniform(-0.2, 0.2, 3),
        "cosine": rng.uniform(-0.2, 0.2, 3),
        "frequency": np.asarray(rng.uniform(1, 6)),
        "rotation": rotation(rng),
        "turn": rng.uniform(-1, 1, (3, 6)),
    }


@dataclass(frozen=True, eq=False)
class PaperCoordinates:
    """The closed loop of plant and law, seen in the state (q, φ, p, z, n, x_d) of (24).

    `function` is (x, u, p) → that state, its rate along `ClosedLoop.rhs` by the chain rule,
    (τ_e, τ_u, ẋ_d), and the powers of `loop.energies`.
    """

    loop: ClosedLoop
    function: cs.Function

    @classmethod
    def of(cls, law: AbstractLaw) -> PaperCoordinates:
        loop = ClosedLoop(law)
        x, s = loop.state.symbols("x")
        u, w = loop.inputs.symbols("u")
        p = cs.SX.sym("p", loop.parameters.size)
        m, _, g, tank = loop.parameters.view(p).values()
        rate, powers = loop.rhs(x, u, p)
        outputs = loop.output_layout.view(loop.outputs(x, u, p))
        phi, dphi = shaped_motion(s.q, s.theta, s.dq, s.dtheta, m.joint_stiffness, g.shaped_stiffness)
        reference = reference_at(s.clock, loop.tank.valve(s.tank_energy, tank), w)
        M = law.robot.arm.mass_matrix(s.q, m)
        state = cs.vertcat(
            s.q,
            phi,
            M @ s.dq,
            g.shaped_inertia * dphi,
            cs.sqrt(2 * s.tank_energy),
            reference.pose.position,
            cs.vec(reference.pose.rotation.T),  # row by row
        )
        signals = [outputs.tau_e, outputs.tau_u, reference.velocity]
        function = cs.Function("paper", [x, u, p], [state, cs.jtimes(state, x, rate), *signals, powers])
        return cls(loop, function)

    def __call__(
        self, x: np.ndarray, u: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        return tuple(np.array(v).ravel() for v in self.function(x, u, p))

    def random_state(self, rng: np.random.Generator, tank_energy: float = 2.0) -> np.ndarray:
        """Return a state with joints stretched by up to 0.02 rad."""
        n = self.loop.law.robot.n
        q = rng.uniform(-2, 2, n)
        return self.loop.state.pack(
            {
                "q": q,
                "theta": q + rng.uniform(-0.02, 0.02, n),
                "dq": rng.uniform(-2, 2, n),
                "dtheta": rng.uniform(-2, 2, n),
                "tank_energy": tank_energy,
                "clock": rng.uniform(0, 1),
            }
        )

    def random_input(self, rng: np.random.Generator) -> np.ndarray:
        """Return a moving reference and a wrench."""
        wrench = {"F_e": rng.uniform(-30, 30, 6), "torque_noise": np.zeros(self.loop.law.robot.n)}
        return self.loop.inputs.pack(random_motion(rng) | wrench)
