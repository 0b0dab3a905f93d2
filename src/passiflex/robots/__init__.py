"""Robots: the serial arm from a URDF, the flexible joints around it, and the catalogue."""

from passiflex.robots.arm import SerialArm as SerialArm
from passiflex.robots.catalogue import catalogue as catalogue
from passiflex.robots.chain import SerialChain as SerialChain
from passiflex.robots.flexible import FlexibleJointRobot as FlexibleJointRobot
