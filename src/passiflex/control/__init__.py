"""Control laws and what they store and dissipate: (5)–(8), (11)–(12), (19)–(23), (30)–(36)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from passiflex.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from passiflex.control.damping_design import damping_from_ratio as damping_from_ratio
    from passiflex.control.gravity import AbstractGravity as AbstractGravity
    from passiflex.control.gravity import MotorGravity as MotorGravity
    from passiflex.control.gravity import RobotGravity as RobotGravity
    from passiflex.control.gravity import StaticGravity as StaticGravity
    from passiflex.control.law import AbstractLaw as AbstractLaw
    from passiflex.control.law import ImpedanceLaw as ImpedanceLaw
    from passiflex.control.rigid import RigidImpedanceLaw as RigidImpedanceLaw
    from passiflex.control.signals import Command as Command
    from passiflex.control.signals import LawEnergy as LawEnergy
    from passiflex.control.signals import Measurement as Measurement
    from passiflex.control.signals import Reference as Reference
    from passiflex.control.systems import augmented_system as augmented_system
    from passiflex.control.systems import impedance_system as impedance_system
    from passiflex.control.systems import shaped_system as shaped_system
    from passiflex.control.tank import EnergyTank as EnergyTank
    from passiflex.control.task import AbstractTask as AbstractTask
    from passiflex.control.task import PoseTask as PoseTask
    from passiflex.control.task import PositionTask as PositionTask

_HOMES = {
    "AbstractGravity": "gravity",
    "AbstractLaw": "law",
    "AbstractTask": "task",
    "Command": "signals",
    "EnergyTank": "tank",
    "ImpedanceLaw": "law",
    "LawEnergy": "signals",
    "Measurement": "signals",
    "MotorGravity": "gravity",
    "PoseTask": "task",
    "PositionTask": "task",
    "Reference": "signals",
    "RigidImpedanceLaw": "rigid",
    "RobotGravity": "gravity",
    "StaticGravity": "gravity",
    "augmented_system": "systems",
    "damping_from_ratio": "damping_design",
    "impedance_system": "systems",
    "shaped_system": "systems",
}

__getattr__, __dir__ = _lazy_names("passiflex.control", _HOMES)
