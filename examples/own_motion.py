# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""Can the reference do something of its own? It is an event that builds its motion from where the reference is."""

import numpy as np

import passiflex as pf
from passiflex.control.motion import hold
from passiflex.scenarios.reference import AbstractReferenceEvent


class Swing(AbstractReferenceEvent):
    """Up and down, until the next motion begins."""

    size: float
    frequency: float

    def build(self, now):
        up = np.array([0, 0, self.size])
        return hold(now) | {"sine": up, "frequency": np.asarray(2 * np.pi * self.frequency)}

    def words(self):
        return f"swing of {self.size:g} m"


run = pf.simulate("arm3_sampled.yaml", reference=[Swing(at=0.5, size=0.02, frequency=1.0)])
print(pf.audit(run).verdict, np.ptp(run["desired_position"][:, 2]))
