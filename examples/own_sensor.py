# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""Can I try a fault of my own in the sensors? It is an effect on the readings, with a memory if it needs one."""

from dataclasses import dataclass

import passiflex as pf
from passiflex.layout import Field, Layout
from passiflex.sampled.sensors import AbstractSensorEffect, Reading


@dataclass(frozen=True)
class Warming(AbstractSensorEffect):
    """An offset of the torque sensors that creeps up from the first reading on."""

    rate: float  # N m/s

    def state(self, n):
        return Layout((Field("warming_offset", (), "N m"),))

    def read(self, y, elapsed, s):
        offset = s.warming_offset + self.rate * elapsed
        return Reading(y._replace(tau_a=y.tau_a + offset), offset)


run = pf.simulate("arm3_sampled.yaml", sensors=[Warming(0.05)])
print(pf.audit(run).verdict, run["warming_offset"][-1])
