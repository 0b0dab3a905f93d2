"""Passive Cartesian impedance control of flexible-joint robots, with its energy accounted for.

    import passiflex as pf

    run = pf.simulate(pf.shipped_scenario("fig1"))
    print(pf.audit(run).verdict)

The rooms, in the order in which they may import each other: `texts`, `robots`, `phs`, `control`, `sampled`, `elements`,
`native`; `scenarios`, `loops`, `problems`, `stability`, `runs`, `engines`, `simulation`, `onboard`; `passivity`,
`metrics`, `limits`, `cards`, `chunks`, `campaigns`; then what looks at their results: `diagrams`, `plotting`,
`reports`, `exports`; then `studies`, `cli`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from passiflex.lazy import lazy_names as _lazy_names
from passiflex.version import __version__ as __version__

if TYPE_CHECKING:
    from passiflex.campaigns import load_campaign as load_campaign
    from passiflex.campaigns import replay as replay
    from passiflex.campaigns import run_campaign as run_campaign
    from passiflex.cards import card as card
    from passiflex.control import ImpedanceLaw as ImpedanceLaw
    from passiflex.control import RigidImpedanceLaw as RigidImpedanceLaw
    from passiflex.exports import export_law as export_law
    from passiflex.limits import check as check
    from passiflex.limits import limit_map as limit_map
    from passiflex.limits import recommend as recommend
    from passiflex.limits import recommend_for as recommend_for
    from passiflex.onboard import ApproachSettings as ApproachSettings
    from passiflex.onboard import Controller as Controller
    from passiflex.onboard import Guard as Guard
    from passiflex.onboard import GuardClient as GuardClient
    from passiflex.onboard import GuardServer as GuardServer
    from passiflex.onboard import Sensed as Sensed
    from passiflex.onboard import Setpoint as Setpoint
    from passiflex.onboard import Twin as Twin
    from passiflex.onboard import WatchSettings as WatchSettings
    from passiflex.onboard import run_on as run_on
    from passiflex.passivity import Audit as Audit
    from passiflex.passivity import audit as audit
    from passiflex.phs import PortHamiltonianSystem as PortHamiltonianSystem
    from passiflex.reports import show as show
    from passiflex.robots import FlexibleJointRobot as FlexibleJointRobot
    from passiflex.robots import catalogue as catalogue
    from passiflex.simulation import Run as Run
    from passiflex.simulation import Scenario as Scenario
    from passiflex.simulation import load_scenario as load_scenario
    from passiflex.simulation import salvage as salvage
    from passiflex.simulation import setpoint_table as setpoint_table
    from passiflex.simulation import simulate as simulate
    from passiflex.simulation import wrench_table as wrench_table
    from passiflex.studies import shipped_scenario as shipped_scenario

_ROOMS = {
    "ApproachSettings": "onboard",
    "Audit": "passivity",
    "Controller": "onboard",
    "FlexibleJointRobot": "robots",
    "Guard": "onboard",
    "GuardClient": "onboard",
    "GuardServer": "onboard",
    "ImpedanceLaw": "control",
    "PortHamiltonianSystem": "phs",
    "RigidImpedanceLaw": "control",
    "Run": "simulation",
    "Scenario": "simulation",
    "Sensed": "onboard",
    "Setpoint": "onboard",
    "Twin": "onboard",
    "WatchSettings": "onboard",
    "audit": "passivity",
    "card": "cards",
    "catalogue": "robots",
    "check": "limits",
    "export_law": "exports",
    "limit_map": "limits",
    "load_campaign": "campaigns",
    "load_scenario": "simulation",
    "recommend": "limits",
    "recommend_for": "limits",
    "replay": "campaigns",
    "run_campaign": "campaigns",
    "run_on": "onboard",
    "salvage": "simulation",
    "shipped_scenario": "studies",
    "setpoint_table": "simulation",
    "wrench_table": "simulation",
    "show": "reports",
    "simulate": "simulation",
}


__getattr__, __dir__ = _lazy_names("passiflex", _ROOMS)
