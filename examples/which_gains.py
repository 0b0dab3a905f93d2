# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""Which gains hold at my rate and delay, whatever is 20 % off?"""

import passiflex as pf

advice = pf.recommend("planar2r", "1 kHz", "1 ms", task="position")
print(advice.sentence)
print(advice.snippet)  # to paste into a scenario
