# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""What does a run look like? After replay_the_worst.py, in the same folder."""

import passiflex as pf

run = pf.Run.load("worst.nc")
print(f"the moving arm beside its signals: {pf.show(run, 'worst.html')}")
print(run.data["tank_energy"].attrs["long_name"], run.data["tank_energy"].attrs["units"])
