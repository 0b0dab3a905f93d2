# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""Can I let something of my own touch the robot? It is an element with one port."""

from dataclasses import dataclass

import casadi as cs

import passiflex as pf
from passiflex.elements import AbstractElement, nothing


@dataclass(frozen=True)
class Brush(AbstractElement):
    """A drag that grows with the square of the speed."""

    strength: float  # N s²/m²

    def act(self, at, s, m):
        drag = self.strength * cs.norm_2(cs.vertcat(at.velocity, 1e-6)) * at.velocity
        return nothing(at.x.q.numel())._replace(force=-drag, lost=cs.dot(drag, at.velocity))


scenario = pf.load_scenario("arm3_sampled.yaml")
run = pf.simulate(scenario, elements=[Brush(20.0)])
print(pf.audit(run).ledger_residual)
