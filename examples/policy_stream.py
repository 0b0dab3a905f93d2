# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""What does the arm make of a policy at 15 Hz, whose messages are late and get lost?"""

import numpy as np

import passiflex as pf

time = np.arange(0, 3.5, 0.01)  # what the policy wants: where the hand goes from its start
wanted = np.column_stack([0.04 * np.sin(2 * time), 0 * time, 0.02 * (1 - np.cos(4 * time))])
scenario = pf.load_scenario("arm3_sampled.yaml").changed(reference=None, duration=3.5)
messages = {"rate": "15 Hz", "delay": "20 ms", "jitter": "40 ms", "lost": "20 %"}

for name, stream in {"each row in time": None, "as messages": messages}.items():
    table = pf.setpoint_table(time, wanted, between="linear", relative=True, stream=stream)
    run = pf.simulate(scenario, reference=table)
    goal = np.column_stack([np.interp(run.time, time, column) for column in wanted.T])
    off = np.linalg.norm(run["position"] - run["position"][0] - goal, axis=1)
    print(f"{name}: the hand is up to {100 * off.max():.1f} cm off, and the run was {pf.audit(run).verdict}")
    print(
        f"  the reference was granted {run['granted_energy'][-1]:.2f} J, and held back for {run['governed_time'][-1]:.2f} s"
    )
