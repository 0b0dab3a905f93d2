# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""What has to be known of an arm, beside its URDF, and how does it hold a push?"""

from pathlib import Path

import passiflex as pf

LINK = """<inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.005" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial>"""
URDF = f"""<robot name="mine"><link name="base"/><link name="upper">{LINK}</link><link name="lower">{LINK}</link><link name="tip"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/>
<limit lower="-3" upper="3" effort="80" velocity="3"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 -1 0"/>
<limit lower="-3" upper="3" effort="40" velocity="3"/></joint>
<joint name="hand" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.4 0 0"/></joint></robot>"""
ROBOT = """name: mine
description: two joints that lift
urdf: mine.urdf
end_effector: tip
source: weighed
joint_stiffness: {value: 6000, unit: N m/rad, source: data sheet of the gears}
joint_damping: {value: 4, unit: N m s/rad, source: assumed}
motor_inertia: {value: [0.8, 0.4], unit: kg m^2, source: rotor times the square of the ratio}
torque_limit: {value: [80, 40], unit: N m, source: data sheet}
velocity_limit: {value: 3, unit: rad/s, source: data sheet}
position_limit: {value: 3, unit: rad, source: data sheet}
"""
Path("mine.urdf").write_text(URDF)
Path("mine.yaml").write_text(ROBOT)
scenario = {
    "name": "push",
    "robot": "mine.yaml",
    "posture": ["30 deg", "60 deg"],
    "law": {
        "type": "impedance",
        "task": "position",
        "shaped_stiffness": {"ratio": 1},
        "shaped_inertia": {"ratio": 0.3},
        "stiffness": {"translation": "300 N/m"},
        "damping": {"ratio": 0.7},
    },
    "forces": [{"from": "0.2 s", "to": "1.2 s", "force": [0, 0, "-15 N"]}],
    "duration": "2 s",
}
run = pf.simulate(scenario)
low = run["position"][:, 2].min() - run["position"][0, 2]
print(f"15 N push it down by {-low * 100:.1f} cm, where 300 N/m alone would give 5 cm")
