"""How far the position in force has been from the one asked for: an extreme of all periods, not of rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from worlds import ran

ROWS = "t,x,y,z\n0.1,0,0,0\n0.2,0.0625,0,0.03125\n0.203,0.2,0,0.1\n0.206,0,0,0.03\n"
"""The third row is asked for from 203 to 206 ms only."""
POOR: dict[str, Any] = {
    "reference": {"rows": ROWS, "relative": True, "between": "held"},
    "tank": {"initial": 0.3},
}


def test_it_is_the_largest_distance_so_far() -> None:
    run = ran(**POOR)
    apart = np.linalg.norm(run["desired_position"] - run["governed_position"], axis=1)
    assert apart.max() > 0.01
    np.testing.assert_allclose(run["largest_lag"], np.maximum.accumulate(apart), rtol=0, atol=1e-15)


def test_what_happened_between_two_rows_is_in_it() -> None:
    fine, coarse = ran(**POOR), ran(**POOR, output_interval=0.02)
    assert coarse["largest_lag"][-1] == fine["largest_lag"][-1]
    seen = np.linalg.norm(coarse["desired_position"] - coarse["governed_position"], axis=1)
    assert seen.max() < 0.9 * coarse["largest_lag"][-1]


def test_what_is_granted_at_once_does_not_lag() -> None:
    run = ran(reference=POOR["reference"], tank={"initial": 50})
    assert not run["largest_lag"].any()
