"""What touches a robot: elements with one port each."""

from passiflex.elements.drag import Drag as Drag
from passiflex.elements.element import AbstractElement as AbstractElement
from passiflex.elements.element import Books as Books
from passiflex.elements.element import Effect as Effect
from passiflex.elements.element import Mobility as Mobility
from passiflex.elements.element import Port as Port
from passiflex.elements.element import Touch as Touch
from passiflex.elements.element import nothing as nothing
from passiflex.elements.end_stops import EndStops as EndStops
from passiflex.elements.friction import MotorFriction as MotorFriction
from passiflex.elements.friction import StickingFriction as StickingFriction
from passiflex.elements.held import Held as Held
from passiflex.elements.motion import motion_of as motion_of
from passiflex.elements.normal import AbstractNormal as AbstractNormal
from passiflex.elements.normal import HuntCrossley as HuntCrossley
from passiflex.elements.normal import Linear as Linear
from passiflex.elements.shapes import AbstractShape as AbstractShape
from passiflex.elements.shapes import Box as Box
from passiflex.elements.shapes import Cylinder as Cylinder
from passiflex.elements.shapes import Plane as Plane
from passiflex.elements.shapes import Sphere as Sphere
from passiflex.elements.speed_brake import SpeedBrake as SpeedBrake
from passiflex.elements.surface import Surface as Surface
