"""The settings of the two laws in a scenario, which build them. All numbers in SI units."""

from __future__ import annotations

import abc
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator, model_validator

from passiflex.scenarios.gain_settings import (
    AbstractGains,
    Damping,
    ShapedInertia,
    ShapedStiffness,
    Stiffness,
    TargetInertia,
    axis_names,
    free_mistakes,
)
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

if TYPE_CHECKING:
    from passiflex.control.law import AbstractLaw
    from passiflex.control.posture import Posture
    from passiflex.control.task import AbstractTask
    from passiflex.robots.flexible import FlexibleJointRobot

Numbers = dict[str, NDArray[np.float64]]

KIND = 0.01
"""What is added to the mobility where J loses a rank, unless a scenario says: a share of 1/m, m the mass that moves."""
LEAST_MASS = 1e-3
"""[kg] Nothing lighter is taken for the mass of a robot."""
EXACT = 1e-9
"""[1/kg] What the rigid law adds: it only guards round-off, as more would not be the inertia that is asked for."""


class AbstractLawSettings(Section, abc.ABC):
    """What all laws have.

    Whoever only reads a scenario needs no CasADi: it is imported where a law is built.
    """

    title: ClassVar[str]
    """The law in words."""
    shapes: ClassVar[bool]
    """Whether it gives the joints another stiffness and the motors another inertia, and has a tank."""

    task: Literal["pose", "position"] = Field(description="all six directions, or position only")
    stiffness: Stiffness = Field(description="stiffness K_x of the Cartesian spring")
    damping: Damping = Field(description="damping D_x")
    null_space_damping: Annotated[float, Quantity("1/s", least=0)] = Field(
        default=0.0, description="damping k_ns of the self-motion, 1/s"
    )
    regularisation: Annotated[float, Quantity("1/kg", least=0)] | None = Field(
        default=None,
        description="ε of Λ = (J M⁻¹ Jᵀ + ε I)⁻¹, 1/kg; 1 % of 1/m if left out, m the mass that moves",
    )

    @field_validator("stiffness", "damping", "target_inertia", check_fields=False)
    @classmethod
    def _sized(cls, gains: AbstractGains, info: ValidationInfo) -> AbstractGains:
        if "task" in info.data:
            gains.require(info.data["task"])
        return gains

    @model_validator(mode="after")
    def _free_in_both(self) -> Self:
        found = free_mistakes(self.damping, self.stiffness.free)
        if found:
            raise Mistakes((("damping",), found))
        return self

    @abc.abstractmethod
    def build(self, robot: FlexibleJointRobot) -> AbstractLaw:
        """Return the law."""

    def settled(self, mass: float) -> Self:
        """Return the settings with a regularisation, for a robot of which so much moves [kg]."""
        if self.regularisation is not None:
            return self
        return self.model_copy(update={"regularisation": self._kind(mass)})

    def _kind(self, mass: float) -> float:
        """Return the regularisation with which nothing turns at once where J loses a rank [1/kg]."""
        return KIND / max(mass, LEAST_MASS)

    @abc.abstractmethod
    def gains(self, law: AbstractLaw, model: Numbers, start: Posture) -> Numbers:
        """Return the numbers of `law.layout`, with the law's model and the start posture as that model sees it.

        Raises
        ------
        SizeError
            For numbers that do not fit the robot's joints.
        """

    def _common(self, start: Posture) -> Numbers:
        from passiflex.control.tool_axes import stiffness_in_world

        K = self.stiffness.full()
        return {
            "stiffness": stiffness_in_world(K, start.pose.rotation) if self.stiffness.in_tool else K,
            "null_space_damping": np.asarray(self.null_space_damping),
            "regularisation": np.asarray(self.regularisation, dtype=np.float64),
        }

    def _damping(self, law: AbstractLaw, start: Posture) -> NDArray[np.float64]:
        """Return D_x in world axes, if it is not given by its ratio."""
        from passiflex.control.tool_axes import damping_in_world

        D = self.damping.full()
        return damping_in_world(D, start.pose.rotation, turned=law.task.turned) if self.damping.in_tool else D

    def _task(self) -> AbstractTask:
        from passiflex.control.task import PoseTask, PositionTask

        return {"pose": PoseTask, "position": PositionTask}[self.task](free=self.stiffness.free)


class ImpedanceSettings(AbstractLawSettings):
    """The paper's law."""

    title: ClassVar[str] = "impedance law for flexible joints"
    shapes: ClassVar[bool] = True

    type: Literal["impedance"] = Field(description="the law: impedance (the paper's) or rigid (the baseline)")
    gravity: Literal["robot", "motor", "static"] = Field(
        default="static",
        description="who carries the weight: the robot itself, ∇V(φ), or ∇V(q̄), which is exact",
    )
    shaped_stiffness: ShapedStiffness = Field(
        description="K_e: {ratio: multiple of K}, or a quantity in N m/rad"
    )
    shaped_inertia: ShapedInertia = Field(description="B_e: {ratio: multiple of B}, or a quantity in kg m^2")

    def build(self, robot: FlexibleJointRobot) -> AbstractLaw:
        """Return the law."""
        from passiflex.control.gravity import MotorGravity, RobotGravity, StaticGravity
        from passiflex.control.law import ImpedanceLaw

        carries = {"robot": RobotGravity, "motor": MotorGravity, "static": StaticGravity}[self.gravity]
        return ImpedanceLaw(robot, self._task(), carries())

    def gains(self, law: AbstractLaw, model: Numbers, start: Posture) -> Numbers:
        """Return the numbers of the law; a damping ratio is designed for the start."""
        from passiflex.control.gain_design import designed_damping

        own, robot = self._common(start), law.robot.name
        own["shaped_stiffness"] = self.shaped_stiffness.resolve(
            model["joint_stiffness"], "law.shaped_stiffness", robot
        )
        own["shaped_inertia"] = self.shaped_inertia.resolve(
            model["motor_inertia"], "law.shaped_inertia", robot
        )
        ratio = self.damping.ratio
        damping = (
            self._damping(law, start)
            if ratio is None
            else designed_damping(law.task, own, start, model, ratio)
        )
        return own | {"damping": damping}


class RigidSettings(AbstractLawSettings):
    """The baseline: cancels the dynamics as if the joints were rigid."""

    title: ClassVar[str] = "baseline for rigid joints"
    shapes: ClassVar[bool] = False

    type: Literal["rigid"] = Field(description="the law: impedance (the paper's) or rigid (the baseline)")
    gravity: Literal["robot", "model"] = Field(
        default="model", description="who carries the weight: the robot itself, or the law by its model"
    )
    target_inertia: TargetInertia = Field(description="inertia M_x that the end effector is to have")
    motor_inertia: Literal["ignored", "carried"] = Field(
        default="ignored", description="whether the law adds the motor inertia to that of the links"
    )

    @model_validator(mode="after")
    def _holds_all(self) -> Self:
        if free := self.stiffness.free:
            what = "the rigid law gives every direction an inertia, and none can be free"
            raise Mistakes((("stiffness",), f"{what}; got {axis_names(free)}; try law type: impedance"))
        return self

    def build(self, robot: FlexibleJointRobot) -> AbstractLaw:
        """Return the law. It cancels the weight by its model; its plant has gravity then."""
        from passiflex.control.gravity import RobotGravity, StaticGravity
        from passiflex.control.rigid import RigidImpedanceLaw

        carries = {"robot": RobotGravity, "model": StaticGravity}[self.gravity]
        return RigidImpedanceLaw(robot, self._task(), carries())

    def _kind(self, mass: float) -> float:
        return EXACT

    def gains(self, law: AbstractLaw, model: Numbers, start: Posture) -> Numbers:
        """Return the numbers of the law."""
        from passiflex.control.damping_design import damping_from_ratio
        from passiflex.control.gain_design import in_world, target_inertia

        own, target = self._common(start), self.target_inertia
        world = in_world(own["stiffness"], start.pose.rotation)
        if target.damping_ratio is not None:
            inertia = target_inertia(world, self._damping(law, start), target.damping_ratio)
        else:
            inertia = target.full()
        ratio = self.damping.ratio
        damping = self._damping(law, start) if ratio is None else damping_from_ratio(world, inertia, ratio)
        carried = model["motor_inertia"] if self.motor_inertia == "carried" else np.zeros(law.robot.n)
        return own | {"target_inertia": inertia, "damping": damping, "carried_inertia": carried}


LawSettings = Annotated[ImpedanceSettings | RigidSettings, Field(discriminator="type")]
"""What `law` may be."""
