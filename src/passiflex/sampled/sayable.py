"""What a robot may say of its joints, by name; who reads a scenario needs no more of it."""

SAYABLE = ("q", "theta", "dq", "dtheta", "tau_a")
"""Positions of links and motors, their velocities, the torque through the joints."""
POSITIONS = frozenset(("q", "theta"))
"""Of which a law needs one."""
