# /// script
# requires-python = ">=3.11"
# dependencies = ["passiflex"]
# ///
"""What happened in the worst of many runs? After campaign.py, in the same folder."""

import passiflex as pf
from passiflex.campaigns import Results
from passiflex.campaigns.run_campaign import worst

results = Results.load("many")
(sample,) = worst(results, "margin", 1)
run = pf.replay("many", sample)
found = pf.audit(run)
print(f"sample {sample} was {found.verdict}: {found.margin:.3f} J were left at {found.margin_time:.3f} s")
run.save("worst.nc")
