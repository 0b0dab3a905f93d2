"""The face of the package in typed code of somebody else: `make check` reads it with mypy --strict, nothing runs it."""

from __future__ import annotations

from pathlib import Path

import passiflex as pf

scenario: pf.Scenario = pf.shipped_scenario("fig1_sampled")
changed: pf.Scenario = scenario.changed({"duration": 4})
run: pf.Run = pf.simulate(changed)
found: pf.Audit = pf.audit(run)
verdict: str = found.verdict
margin: float = found.margin
page: Path = pf.show(run, "run.html")
saved: Path = run.save("run.nc")
again: pf.Run = pf.Run.load(saved)
names: tuple[str, ...] = pf.catalogue()
robot: pf.FlexibleJointRobot = pf.FlexibleJointRobot.load("iiwa14")
law: pf.ImpedanceLaw = pf.ImpedanceLaw(robot)
stable: bool = pf.check(scenario).stable
advice = pf.recommend(robot, "1 kHz", "1 ms")
snippet: str = advice.snippet
version: str = pf.__version__
campaign = pf.load_campaign("many.yaml")
results = pf.run_campaign(campaign, "out")
worst: pf.Run = pf.replay(results.folder, 3)
