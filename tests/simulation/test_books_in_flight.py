"""In runs: what a tank claims, less its bound, is there; and a stable loop at its floor is not called active."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from passiflex.passivity import audit, overclaimed
from passiflex.simulation import Run
from worlds import PERIOD, merged, ran

SENSORS: dict[str, Any] = {
    "link_resolution": "0.01 deg",
    "motor_resolution": "0.0001 deg",
    "velocity": "differences",
    "velocity_filter": "200 Hz",
}
CIRCLE = [
    {"at": 0.1, "kind": "step", "by": [0.05, 0, 0.05]},
    {"at": 0.5, "kind": "circle", "plane": ["x", "z"], "radius": 0.06, "period": 1.0},
]
DRIVEN: dict[str, Any] = {
    "law": {"shaped_inertia": {"ratio": 0.2}},
    "control": {"external_torque": "none", "inner_loop": "matched", "delay": PERIOD},
    "motors": {"torque_limit": "robot"},
    "sensors": SENSORS,
    "reference": CIRCLE,
    "duration": 3.0,
}
DRAG = {"drags": [{"from": 0.3, "to": 60.0, "viscous": 20.0}]}
ERRORS: dict[str, dict[str, Any]] = {
    "white noise": {"noise": {"torque_variance": 0.5, "hold": PERIOD}},
    "noise of 10 ms": {"noise": {"torque_variance": 0.2, "hold": 0.01}},
    "offset": {"sensors": {"torque_offset": [0.8, -1.0]}},
    "the other way": {"sensors": {"torque_offset": [-0.8, 1.0]}},
    "scale": {"sensors": {"torque_scale": [-0.03, 0.03]}},
    "low-pass": {"sensors": {"torque_bandwidth": "400 Hz"}},
    "missed": {"control": {"missed": 0.3}},
    "encoders": {"sensors": {"link_offset": 0.01, "motor_offset": -0.01, "link_resolution": "0.1 deg"}},
    "everything": {
        "noise": {"torque_variance": 0.2, "hold": 0.005},
        "sensors": {"torque_offset": [0.3, 0.3], "torque_scale": 0.02, "torque_bandwidth": "600 Hz"},
        "control": {"missed": 0.2},
    },
}


@pytest.mark.parametrize("drag", [{}, DRAG], ids=["free", "drag"])
@pytest.mark.parametrize("name", ERRORS)
def test_what_is_claimed_less_its_bound_is_there(name: str, drag: dict[str, Any]) -> None:
    """∫ τ_aᵀ q̇ − Σw ≤ E at every reading, and what was granted left the floor standing by then; the books close."""
    run = ran(**merged(merged(DRIVEN, ERRORS[name]), drag))
    error, bound = overclaimed(run), run["measurement_bound"]
    assert (error <= bound + 1e-12).all()
    assert (bound >= 0).all()
    books = run["tank_energy"] + run["law_storage"] + run["measured_port_energy"] + run["spilled_energy"]
    assert np.ptp(books) < 1e-12
    granting = np.append(False, np.diff(run["granted_energy"]) > 0)
    assert (run["tank_energy"] - bound)[granting].min() >= 0.1 - 1e-12


def test_a_bound_is_not_a_thousand_times_too_large() -> None:
    """With the worst signs an offset's bound is the error itself; a scale's is a tenth of a percent from it."""
    worst = {}
    for name in ("offset", "the other way"):
        run = ran(**merged(DRIVEN, ERRORS[name]))
        worst[name] = (overclaimed(run) / np.maximum(run["measurement_bound"], 1e-3)).max()
    assert max(worst.values()) > 0.7


def resting(seed: int, **changes: Any) -> Run:
    """Return 20 s at the floor: noise, drag, and a circle that the tank cannot pay for."""
    poor = {
        "tank": {"initial": 0.3},
        "noise": {"torque_variance": 1.0, "hold": PERIOD},
        "duration": 20.0,
        "seed": seed,
    }
    return ran(**merged(merged(merged(DRIVEN, DRAG), poor), {"output_interval": 0.01} | changes))


@pytest.mark.parametrize("seed", range(4))
def test_a_stable_loop_that_rests_at_its_floor_does_not_fall_back(seed: int) -> None:
    """Noise takes the level from the floor to far below the trip; what it explains is not held against the loop."""
    run = resting(seed)
    assert not run["latched"].any()
    assert run["governed_time"][-1] > 10
    assert audit(run).verdict == "passive"
    assert (overclaimed(run) <= run["measurement_bound"]).all()


def test_a_claim_stands_from_one_reading_to_the_next() -> None:
    """Rows of missed periods hold the reading before: what is claimed beyond the truth does not move in them."""
    run = ran(**merged(DRIVEN, {"control": {"missed": 0.3}}))
    stale = np.flatnonzero(run.time - run["read_time"] > 1e-7)
    assert 0.2 < stale.size / run.time.size < 0.4
    beyond = overclaimed(run)
    np.testing.assert_array_equal(beyond[stale], beyond[stale - 1])
    assert np.ptp(run["joint_energy"][stale] - run["joint_energy"][stale - 1]) > 0


def test_offsets_of_encoders_do_not_touch_the_books() -> None:
    """Σw knows differences of q only: the error stays that of an arm without them, and E is no larger."""
    clean, offset = (
        ran(**merged(DRIVEN, {"sensors": s})) for s in ({}, {"link_offset": 0.02, "motor_offset": 0.02})
    )
    assert offset["measurement_bound"][-1] < 2 * clean["measurement_bound"][-1] + 1e-3
    assert np.abs(overclaimed(offset)).max() < 2e-3
    np.testing.assert_allclose(offset["measured_q"] - offset["q"], 0.02, rtol=0, atol=1e-4)
