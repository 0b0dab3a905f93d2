"""The sweep is made of the figures' own scenarios, and its points are those of single runs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest

from passiflex.studies import sensitivity
from passiflex.studies.sensitivity import Variant, circle_variants, run_sensitivity, step_variants


def test_two_points_of_each_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def few(variants: Iterator[Variant]) -> list[Variant]:
        return list(islice(variants, 2))

    steps, circles = few(step_variants()), few(circle_variants())
    monkeypatch.setattr(sensitivity, "step_variants", lambda: iter(steps))
    monkeypatch.setattr(sensitivity, "circle_variants", lambda: iter(circles))
    paths = run_sensitivity(tmp_path)
    assert [p.name for p in paths] == ["sensitivity.png", "sensitivity.pdf", "sensitivity.json"]
    numbers = json.loads((tmp_path / "sensitivity.json").read_text())
    assert set(numbers) == {"posture", "circle"}
    chosen = numbers["posture"]["chosen"]
    assert chosen["proposed overshoot"] < chosen["baseline overshoot"]
    assert all(point["margin"] > 0 for point in numbers["circle"].values())


def test_every_variant_is_another_one() -> None:
    seen = [(v.sweep, v.label) for v in (*step_variants(), *circle_variants())]
    assert len(seen) == len(set(seen))
    assert {v.robot.joint_stiffness[0] for v in step_variants()} >= {4000, 7000, 10000, 15000}
    assert {v.robot.joint_damping[0] for v in step_variants()} >= {1, 2, 5, 10}
