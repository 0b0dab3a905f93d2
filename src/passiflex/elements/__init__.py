"""What touches a robot: elements with one port each."""

from passiflex.elements.drag import Drag as Drag
from passiflex.elements.element import AbstractElement as AbstractElement
from passiflex.elements.element import Books as Books
from passiflex.elements.element import Effect as Effect
from passiflex.elements.element import Touch as Touch
from passiflex.elements.element import nothing as nothing
from passiflex.elements.friction import MotorFriction as MotorFriction
