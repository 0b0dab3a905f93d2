# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""Can I try a tank of my own? It is its flow."""

import casadi as cs

import passiflex as pf
from passiflex.sampled.tank import AbstractTank
from passiflex.sampled.tanks import PortTank


class Leaking(AbstractTank):
    kind, title, reads = "leaking", "leaking tank", PortTank.reads
    measures = falls_back = True  # as its level follows from the port

    def flow(self, flows, g):
        flow = -flows.storage_change - flows.port_energy
        return flow - cs.fmax(flow, 0) / 10


scenario = pf.load_scenario("arm3_sampled.yaml")
run = pf.simulate(scenario, tank=Leaking())
print(pf.audit(run).verdict)
