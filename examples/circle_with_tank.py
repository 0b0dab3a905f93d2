# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""What does it cost to move the reference, and who pays?"""

# %% the scenario
import passiflex as pf

scenario = {
    "name": "circle",
    "robot": "planar2r",
    "posture": ["30 deg", "60 deg"],
    "law": {
        "type": "impedance",
        "task": "position",
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 0.3},
        "stiffness": {"translation": "300 N/m"},
        "damping": {"ratio": 0.7},
    },
    "control": {"rate": "1 kHz", "delay": "1 ms", "inner_loop": "matched"},
    "tank": {"kind": "port", "initial": "1 J"},
    "reference": [{"at": "0.2 s", "kind": "circle", "plane": ["x", "z"], "radius": "5 cm", "period": "2 s"}],
    "duration": "4 s",
}

# %% the run
run = pf.simulate(scenario)
print(
    f"the reference was granted {run['granted_energy'][-1]:.3f} J and held back for {run['governed_time'][-1]:.2f} s"
)
print(f"the tank had 1 J, at least {run['lowest_level'][-1]:.3f} J, and has {run['tank_energy'][-1]:.3f} J")

# %% the verdict
print(f"the run was {pf.audit(run).verdict}")
