"""The Cartesian spring of (12): a potential on poses, and its true gradient."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import casadi as cs

from passiflex.control.signals import Contribution
from passiflex.robots.arm import EndEffectorPose


class Spring(NamedTuple):
    """A potential and its derivatives on SE(3), in world axes.

    Attributes
    ----------
    potential: U(x; x_d) [J], ≥ 0 and zero at x = x_d.
    gradient: The wrench that holds the end effector against the spring, (6,) N and N m:
        U̇ = gradientᵀ ẋ with x_d at rest, ẋ linear then angular velocity.
    reference_gradient: The same for the reference, (6,): P_X = reference_gradientᵀ ẋ_d, (21).
    """

    potential: cs.SX
    gradient: cs.SX
    reference_gradient: cs.SX


def manifold_gradient(potential: cs.SX, position: cs.SX, rotation: cs.SX) -> cs.SX:
    """Return the gradient of U(p, R) for ṗ = v and Ṙ = [ω]× R, as a wrench (6,) in world axes.

    With rⱼ the columns of R, U̇ = Σⱼ (∂U/∂rⱼ)ᵀ (ω × rⱼ) = ωᵀ Σⱼ rⱼ × ∂U/∂rⱼ.
    """
    slope = cs.gradient(potential, rotation)
    torque = sum(cs.cross(rotation[:, j], slope[:, j]) for j in range(3))
    return cs.vertcat(cs.gradient(potential, position), torque)


class Impedance(NamedTuple):
    """The Cartesian spring and damper of (12) together: what they contribute, and how the reference feels it."""

    contribution: Contribution
    reference_gradient: cs.SX


class AbstractTask(abc.ABC):
    """Which part of the pose the spring and the damper act on.

    `size` rows of the Jacobian take part; K_x and D_x are (size, size). Translation is measured in
    world axes; the stiffness of the rotation in the axes of the reference frame, its damping in world axes.

    The axes `free` (of size) have neither stiffness nor damping: a motion along them belongs to the
    self-motion. A rotation can be free about axes of the reference frame, as that of a tool; then the
    damping of the rotation is in the axes of the reference too.
    """

    size: ClassVar[int]
    turns: ClassVar[bool] = False
    """Whether it holds an orientation."""
    free: tuple[int, ...]

    @property
    def held(self) -> tuple[int, ...]:
        """Return the axes that are not free."""
        return tuple(i for i in range(self.size) if i not in self.free)

    @property
    def turned(self) -> bool:
        """Return whether the damping of the rotation is in the axes of the reference, as its stiffness is."""
        return any(i >= 3 for i in self.free)

    def basis(self, desired: EndEffectorPose) -> cs.SX:
        """Return S (size, rank), the directions that are held, as orthonormal columns in world axes.

        Sᵀ J is the Jacobian of what spring and damper act on, and S D Sᵀ the damping in world axes.
        """
        axes = cs.SX.eye(self.size)
        if self.turned:
            axes = cs.diagcat(cs.SX.eye(3), desired.rotation)
        return axes[:, list(self.held)]

    @abc.abstractmethod
    def potential(self, pose: EndEffectorPose, desired: EndEffectorPose, stiffness: cs.SX) -> cs.SX:
        """Return U(x; x_d) [J] for the stiffness K_x (size, size)."""

    @abc.abstractmethod
    def error(self, pose: EndEffectorPose, desired: EndEffectorPose) -> cs.SX:
        """Return x − x_d (size,) in world axes: exact for the position, to third order in the angle for the rest."""

    def spring(self, pose: EndEffectorPose, desired: EndEffectorPose, stiffness: cs.SX) -> Spring:
        """Return the potential with its exact gradients."""
        p, R = cs.SX.sym("p", 3), cs.SX.sym("R", 3, 3)
        p_d, R_d = cs.SX.sym("p_d", 3), cs.SX.sym("R_d", 3, 3)
        K = cs.SX.sym("K", self.size, self.size)
        U = self.potential(EndEffectorPose(p, R), EndEffectorPose(p_d, R_d), K)
        f = cs.Function(
            "U", [p, R, p_d, R_d, K], [U, manifold_gradient(U, p, R), manifold_gradient(U, p_d, R_d)]
        )
        return Spring(*f(pose.position, pose.rotation, desired.position, desired.rotation, stiffness))

    def impedance(
        self,
        pose: EndEffectorPose,
        desired: EndEffectorPose,
        jacobian: cs.SX,
        velocity: cs.SX,
        stiffness: cs.SX,
        damping: cs.SX,
    ) -> Impedance:
        """Return −Jᵀ ∂U/∂x − Jᵀ D_x ẋ of (12), with the storage U and the dissipation ẋᵀ D_x ẋ.

        `jacobian` is J(φ) (size, n) and `velocity` ẋ = J(φ) φ̇ (size,): the damper uses the geometric
        Jacobian, and dissipates whatever the orientation error.
        """
        spring, S, held = self.spring(pose, desired, stiffness), self.basis(desired), list(self.held)
        moving = S.T @ velocity
        wrench = damping[held, held] @ moving
        torque = -jacobian.T @ (spring.gradient[: self.size] + S @ wrench)
        dissipation = cs.dot(moving, wrench)
        return Impedance(Contribution(torque, spring.potential, dissipation), spring.reference_gradient)


@dataclass(frozen=True)
class PoseTask(AbstractTask):
    """All six directions, with the trace potential for the rotation.

    U = ½ eᵀ K_t e + eᵀ K_c ε + tr(G (I − R_dᵀ R)),  G = ½ tr(K_o) I − K_o

    with K_x = [[K_t, K_c], [K_cᵀ, K_o]], e = p − p_d and ε = ½ vee(R_dᵀR − RᵀR_d). The trace term is
    2 vᵀ K_o v with v the vector part of the quaternion of R_dᵀR, never less than ½ εᵀ K_o ε: so U is
    never less than ½ [e; ε]ᵀ K_x [e; ε], also with coupling, and is smooth everywhere.

    Where K_o is 0 about an axis of the reference, U is 0 at every turn about it: a rotation about the tool is free.
    """

    size: ClassVar[int] = 6
    turns: ClassVar[bool] = True
    free: tuple[int, ...] = ()

    def potential(self, pose: EndEffectorPose, desired: EndEffectorPose, stiffness: cs.SX) -> cs.SX:
        """Return U [J]."""
        K_t, K_c, K_o = stiffness[:3, :3], stiffness[:3, 3:], stiffness[3:, 3:]
        e = pose.position - desired.position
        relative = desired.rotation.T @ pose.rotation
        epsilon = cs.inv_skew(relative - relative.T) / 2
        G = cs.trace(K_o) / 2 * cs.SX.eye(3) - K_o
        return cs.dot(e, K_t @ e) / 2 + cs.dot(e, K_c @ epsilon) + cs.trace(G @ (cs.SX.eye(3) - relative))

    def error(self, pose: EndEffectorPose, desired: EndEffectorPose) -> cs.SX:
        """Return the position error, and the axis of the turn from R_d to R times the sine of its angle."""
        turn = pose.rotation @ desired.rotation.T
        return cs.vertcat(pose.position - desired.position, cs.inv_skew(turn - turn.T) / 2)


@dataclass(frozen=True)
class PositionTask(AbstractTask):
    """Position only: U = ½ eᵀ K_x e with e = p − p_d; the orientation is free."""

    size: ClassVar[int] = 3
    free: tuple[int, ...] = ()

    def potential(self, pose: EndEffectorPose, desired: EndEffectorPose, stiffness: cs.SX) -> cs.SX:
        """Return U [J]."""
        e = pose.position - desired.position
        return cs.dot(e, stiffness @ e) / 2

    def error(self, pose: EndEffectorPose, desired: EndEffectorPose) -> cs.SX:
        """Return the position error."""
        return pose.position - desired.position
