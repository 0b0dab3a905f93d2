# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""Can I try a law of my own?"""

from dataclasses import dataclass

import passiflex as pf
from passiflex.control import PositionTask, StaticGravity
from passiflex.control.law import AbstractLaw, ImpedanceLaw
from passiflex.layout import Field, Layout


@dataclass(frozen=True, eq=False)
class Braked(AbstractLaw):
    """The paper's law with a brake on the shaped motors."""

    inner: ImpedanceLaw
    has_tank = True
    shapes = True
    robot = property(lambda self: self.inner.robot)
    task = property(lambda self: self.inner.task)
    gravity = property(lambda self: self.inner.gravity)

    @property
    def layout(self):
        return self.inner.layout + Layout((Field("brake", (), "N m s/rad"),))

    def command(self, y, reference, m, g, added=0.0):
        return self.inner.command(y, reference, m, g, added - g.brake * self.stored(y, m, g).dphi)

    def stored(self, y, m, g):
        return self.inner.stored(y, m, g)

    def posture_at_rest(self, q, theta, K, gains):
        return self.inner.posture_at_rest(q, theta, K, gains)

    def motors(self, m, g):
        return self.inner.motors(m, g)


scenario = pf.load_scenario("arm3_step.yaml")
robot = pf.FlexibleJointRobot.load(scenario.robot)
law = Braked(ImpedanceLaw(robot, PositionTask(), StaticGravity()))
run = pf.simulate(scenario, law=law, gains={"brake": 5.0})
moved = run["position"][-1] - run["position"][0]
print(f"it moved up by {100 * moved[2]:.2f} cm of 5 cm; the run was {pf.audit(run).verdict}")
