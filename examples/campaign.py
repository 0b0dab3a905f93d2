# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""How often does it go well, over robots that are not quite as described?"""

import passiflex as pf
from passiflex.campaigns import parse_campaign

CAMPAIGN = """
name: many
scenario:
  name: step
  robot: planar2r
  posture: [30 deg, 60 deg]
  law: {type: impedance, task: position, shaped_stiffness: {ratio: 1}, shaped_inertia: {ratio: 0.3}, stiffness: {translation: 300 N/m}, damping: {ratio: 0.7}}
  control: {rate: 1 kHz, delay: 1 ms, inner_loop: matched}
  tank: {kind: port, initial: 1 J}
  reference: [{at: 0.2 s, kind: step, by: [0, 0, 5 cm]}]
  duration: 1 s
samples: 32
parameters:
  deviations.joint_stiffness: {distribution: uniform, low: -30 %, high: 30 %, per: joint}
  deviations.link_inertia: {distribution: uniform, low: -20 %, high: 20 %, per: joint}
"""
if __name__ == "__main__":  # it starts processes
    results = pf.run_campaign(parse_campaign(CAMPAIGN), "many")
    rows = results.rows(["verdict", "margin", "overshoot"]).to_pylist()
    passive = sum(row["verdict"] == "passive" for row in rows)
    print(f"{passive} of {len(rows)} passive, least margin {min(row['margin'] for row in rows):.3f} J")
