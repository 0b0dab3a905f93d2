"""Port-Hamiltonian systems as values (1), and the robot (3)–(4) as one of them."""

from passiflex.phs.mechanics import flexible_robot_system as flexible_robot_system
from passiflex.phs.system import PortHamiltonianSystem as PortHamiltonianSystem
from passiflex.phs.system import Structure as Structure
