"""The port tank knows measured quantities only: what bounds Σw, and how far Σw may be from the energy itself."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy import stats

from passiflex.passivity import audit, available_energy
from passiflex.passivity.ledger import motor_side_storage
from passiflex.simulation import Run
from worlds import PERIOD, books, merged, ran

PARAMETERS = ("joint_stiffness", "joint_damping", "motor_inertia", "link_inertia")
WRONG: dict[str, Any] = {
    "law": {
        "shaped_stiffness": {"ratio": None, "value": 7000},
        "shaped_inertia": {"ratio": None, "value": [0.7, 0.5]},
    },
    "model_errors": dict.fromkeys(PARAMETERS, 0.5),
    "forces": [{"from": 0.3, "to": 0.4, "force": [20, 0, -10]}],
}
"""K_e and B_e in numbers, so that the model's K and B matter; and a push that loads the Cartesian spring."""
NOISE = 0.5
SEEDS = 20


def gap(run: Run) -> np.ndarray:
    """Return Σw − ∫ τ_aᵀ q̇ [J]."""
    return run["measured_port_energy"] - run["joint_energy"]


def mean_torque(run: Run) -> np.ndarray:
    """Return ½ (τ_a,k + τ_a,k+1), by which a trapezoid multiplies q_k+1 − q_k."""
    tau_a = run["tau_a"]
    return (tau_a[1:] + tau_a[:-1]) / 2


@pytest.mark.parametrize(
    "signs", list(product((-0.5, 0.5), repeat=4)), ids=lambda s: "".join("-+"[x > 0] for x in s)
)
def test_a_wrong_model_gives_no_more_than_there_was(signs: tuple[float, ...]) -> None:
    """Every parameter wrong by half: Σw ≤ S_0 + T_0 since T, S ≥ 0, and ∫ τ_aᵀ q̇ is no more, but for the gap."""
    run = ran(**merged(WRONG, {"model_errors": dict(zip(PARAMETERS, signs, strict=True))}))
    assert not run.failure
    np.testing.assert_allclose(books(run), 2.0, rtol=0, atol=1e-13)
    assert min(run["tank_energy"].min(), run["law_storage"].min()) >= 0
    allowed = run["law_storage"][0] + run["tank_energy"][0]
    assert run["measured_port_energy"].max() <= allowed
    true = motor_side_storage(run)[0] + run["tank_energy"][0]
    assert true == pytest.approx(allowed, abs=1e-12)
    worst = np.abs(gap(run)).max()
    assert run["joint_energy"].max() <= true + worst
    assert available_energy(run).min() >= -worst
    assert audit(run).verdict == "passive"
    assert audit(run).books_error <= worst * (1 + 1e-9)
    assert worst < 2e-3


def test_a_wrong_model_with_gravity_in_it_as_well() -> None:
    """The weight is believed half as heavy, and the arm sags: T + S + Σw stays, and nothing is made."""
    run = ran(**merged(WRONG, {"law": {"gravity": "static"}, "model_errors": {"link_inertia": -0.5}}))
    np.testing.assert_allclose(books(run), books(run)[0], rtol=0, atol=1e-12)
    assert run["position"][:, 2].min() < run["position"][0, 2] - 0.02
    assert run["tank_energy"].min() > 0
    assert available_energy(run).min() >= -np.abs(gap(run)).max()


@pytest.mark.parametrize("kind", ["step", "move"])
def test_the_trapezoid_is_of_second_order(kind: str) -> None:
    """Between two samples τ_a and q̇ bend: the gap is 4 times smaller at twice the rate, 0.15 mJ of 0.7 J at 1 kHz."""
    motion = {"at": 0.1, "kind": kind, "by": [0, 0, 0.05]} | ({"duration": 0.2} if kind == "move" else {})
    changes = merged(WRONG, {"reference": [motion], "output_interval": 2e-3})
    worst = [
        np.abs(gap(ran(**merged(changes, {"control": {"rate": rate}})))).max()
        for rate in (1000, 2000, 4000, 8000)
    ]
    assert worst[0] < 2e-4
    order = -np.diff(np.log2(worst))
    np.testing.assert_allclose(order, 2, rtol=0, atol=0.03)


@pytest.mark.parametrize("delay", [0.0, PERIOD])
def test_noise_makes_a_random_walk_of_the_gap(delay: float) -> None:
    """Σw − W is a sum of n_kᵀ Δq_k: no drift, and the standard deviation σ √(Σ|Δq|²).

    Of 20 seeds the sum of squares is within the 99.8 % of χ², the mean within 3.1 standard errors. With a
    Δq that is small and smooth this is 6 mJ for 0.5 N m at 1 kHz: below the floor of the tank.
    """
    changes = merged(WRONG, {"control": {"delay": delay}})
    without = gap(ran(**changes))[-1]
    scores = []
    for seed in range(SEEDS):
        noisy = ran(**changes, noise={"torque_variance": NOISE**2, "hold": PERIOD}, seed=seed)
        deviation = NOISE * np.sqrt((np.diff(noisy["q"], axis=0) ** 2).sum())
        assert 5e-3 < deviation < 8e-3
        scores.append((gap(noisy)[-1] - without) / deviation)
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], SEEDS)
    assert low < np.sum(np.square(scores)) < high
    assert abs(np.mean(scores)) < stats.norm.isf(1e-3) / np.sqrt(SEEDS)


@pytest.mark.parametrize("resolution", [1e-5, 1e-4, 1e-3])
def test_quantisation_cannot_wind_up(resolution: float) -> None:
    """By parts, Σ aᵀ Δe = [aᵀ e] − Σ Δaᵀ e with |e| ≤ r/2: what counts is how far τ_a went, not how long it took.

    From rest to rest the gap is at most r/2 Σ|Δτ_a|; otherwise the torques at both ends come to it.
    """
    run = ran(**merged(WRONG, {"sensors": {"link_resolution": resolution}, "duration": 3.0}))
    a, torque = mean_torque(run), run["tau_a"]
    ideal = np.cumsum((a * np.diff(run["q"], axis=0)).sum(axis=1))
    error = np.abs(run["measured_port_energy"][1:] - ideal)
    path = np.cumsum(np.abs(np.diff(a, axis=0, prepend=a[:1])).sum(axis=1))
    ends = np.abs(a).sum(axis=1) + np.abs(a[0]).sum()
    assert (error <= resolution / 2 * (path + ends) * (1 + 1e-9) + 1e-15).all()
    assert error.max() > 0.1 * resolution / 2 * path[-1]
    walked = np.abs(np.diff(torque, axis=0)).sum() + np.abs(torque[[0, -1]]).sum()
    assert error[-1] <= resolution / 2 * walked


@pytest.mark.parametrize("seed", range(3))
def test_the_bound_stands_whatever_happens_in_between(seed: int) -> None:
    """Late, missed, saturated, quantised, noisy, badly modelled and rubbed: T + S + Σw stays and bounds Σw."""
    rng = np.random.default_rng(seed)
    errors = dict(zip(PARAMETERS, rng.choice([-0.5, 0.5], 4), strict=True))
    run = ran(
        **merged(
            WRONG,
            {
                "model_errors": errors,
                "control": {"delay": 0.2e-3, "jitter": 0.3e-3, "missed": 0.1},
                "sensors": {"link_resolution": 1e-4, "velocity": "differences", "velocity_filter": 200},
                "motors": {"torque_limit": "robot", "torque_rate_limit": 3e3, "coulomb_friction": 1},
                "noise": {"torque_variance": 1.0, "hold": PERIOD},
                "reference": [{"at": 0.1, "kind": "step", "by": [-0.1, 0, 0.2]}],
                "forces": [{"from": 0.8, "to": 1.2, "force": [20, 0, 20]}],
                "tank": {"initial": 12, "cap": 12},
                "duration": 1.5,
                "seed": seed,
            },
        )
    )
    np.testing.assert_allclose(books(run), 12.0, rtol=0, atol=1e-12)
    assert run["tank_energy"].min() > 0
    assert run["law_storage"].min() >= 0
    assert run["measured_port_energy"].max() <= 12.0
    assert run["spilled_energy"][-1] > 0
    moved = np.abs(np.diff(run["tau_m"], axis=0))
    assert np.isclose(moved, 3e3 * PERIOD, rtol=1e-9).sum() > 50
    assert audit(run).verdict == "passive"
