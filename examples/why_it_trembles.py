# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""Why does my arm tremble, and what is the least that helps?"""

# %% the scenario
import passiflex as pf

scenario = {
    "name": "trembling",
    "robot": "planar2r",
    "posture": ["30 deg", "60 deg"],
    "law": {
        "type": "impedance",
        "task": "position",
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 0.05},
        "stiffness": {"translation": "300 N/m"},
        "damping": {"ratio": 0.7},
    },
    "control": {"rate": "1 kHz", "delay": "1 ms"},
    "duration": "1 s",
}

# %% the answer
answer = pf.check(scenario)
print(answer.sentence)
print(f"{answer.spectrum.frequency:.0f} Hz at joint {answer.spectrum.joint}")
