# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""How does the end effector answer a step of its reference, and was that passive?"""

import passiflex as pf

scenario = {
    "name": "step",
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
    "reference": [{"at": "0.2 s", "kind": "step", "by": [0, 0, "5 cm"]}],
    "duration": "2 s",
}
run = pf.simulate(scenario)
height = run["position"][:, 2] - run["position"][0, 2]
print(f"after {run.time[-1]:g} s: {height[-1] * 100:.2f} cm of 5 cm, at most {height.max() * 100:.2f} cm")
print(f"the run was {pf.audit(run).verdict}")
