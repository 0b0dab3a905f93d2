"""The verdict on sampled runs: read at the port, whatever the tank says; and how much a tank claims beyond that."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from passiflex.errors import RunFileError
from passiflex.passivity import (
    audit,
    available_energy,
    claimed_balance,
    overclaimed,
    port_tank,
    robot_balance,
)
from passiflex.simulation import Run
from worlds import PERIOD, books, by_rows, merged, ran

PAPER: dict[str, Any] = {
    "law": {"shaped_stiffness": {"ratio": 10}, "shaped_inertia": {"ratio": 0.01}},
    "control": {"external_torque": "measured", "allow_unstable": True},
}
"""The paper's gains, at 1 kHz unstable on this arm as on the iiwa."""
LATE_AND_LIMITED = {"control": {"delay": PERIOD}, "motors": {"torque_limit": "robot"}, "duration": 10.0}


def random_scenario(seed: int) -> dict[str, Any]:
    """Return a stable loop with everything that a robot has, pushed and moved about."""
    rng = np.random.default_rng(seed)
    stiffness = rng.uniform(50, 400)
    return {
        "posture": rng.uniform(0.4, 1.2, 2),
        "law": {
            "gravity": rng.choice(["robot", "static"]).item(),
            "shaped_inertia": {"ratio": rng.uniform(0.5, 1.5)},
            "stiffness": {"translation": stiffness},
            "damping": {"translation": rng.uniform(20, 60)},
        },
        "control": {"delay": rng.uniform(0, 1e-3), "jitter": 0.2e-3, "missed": 0.1, "external_torque": "measured"},
        "sensors": {"link_resolution": 1e-5, "torque_bandwidth": 400},
        "motors": {"torque_limit": "robot", "coulomb_friction": rng.uniform(0, 2)},
        "noise": {"torque_variance": 0.04, "hold": PERIOD},
        "drags": [{"from": 0.2, "to": 0.9, "viscous": rng.uniform(0, 10)}],
        "forces": [{"from": 0.5, "to": 0.7, "force": [*rng.normal(size=2) * 10, 5]}],
        "reference": [
            {"at": 0.1, "kind": "step", "by": [rng.uniform(-0.1, 0), 0, rng.uniform(-0.1, 0.1)]},
            {"at": 0.4, "kind": "circle", "plane": ["x", "z"], "radius": 0.05, "period": rng.uniform(0.5, 2)},
        ],
        "model_errors": {"link_inertia": rng.uniform(-0.1, 0.1), "motor_inertia": rng.uniform(-0.3, 0.3)},
        "duration": 1.5,
        "seed": seed,
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(12))
def test_a_stable_loop_is_never_called_active(seed: int) -> None:
    """Its noise walks by far less than the floor of the tank, nor does the tank claim that much too much."""
    run = ran(**random_scenario(seed))
    assert not run.failure
    assert not run["latched"].any()
    result = audit(run)
    assert result.verdict == "passive"
    assert result.margin > 0
    walk = 0.2 * np.sqrt((np.diff(run["q"], axis=0) ** 2).sum())
    assert walk < 0.01
    assert result.books_error < 0.1
    assert result.books_error == pytest.approx(max(0.0, overclaimed(run).max()), abs=1e-12)
    assert result.integration_error < 1e-6
    assert result.ledger_residual < 1e-6
    np.testing.assert_allclose(claimed_balance(run).residual, 0, rtol=0, atol=1e-12)


def test_what_is_there_is_what_a_perfect_tank_would_hold() -> None:
    """T − T_port of the port tank is the trapezoid's error, 2 µJ of 2 J for ideal sensors; available is T_port + S̃."""
    run = ran()
    assert np.abs(overclaimed(run)).max() < 1e-5
    np.testing.assert_allclose(port_tank(run), run["tank_energy"], rtol=0, atol=1e-5)
    np.testing.assert_allclose(available_energy(run), port_tank(run) + run["law_storage"], rtol=0, atol=1e-9)


@lru_cache
def limit_cycle(kind: str) -> Run:
    """Return ten seconds of the saturated limit cycle in which these gains end, with a tank of this kind."""
    run = ran(**merged(PAPER, LATE_AND_LIMITED | {"tank": {"kind": kind}}))
    assert not run.failure
    assert (np.abs(run["tau_m"][-500:]) == [100, 50]).any()
    return run


def test_the_papers_tank_is_credited_what_nobody_dissipated() -> None:
    """P_D of the formula, summed at the samples: more than 10 J in 10 s. The port tank claims 0.02 J too much."""
    paper, port = audit(limit_cycle("paper")), audit(limit_cycle("port"))
    assert paper.books_error > 10
    assert port.books_error < 0.05
    assert limit_cycle("paper")["tank_energy"][-1] > 12
    assert limit_cycle("port")["tank_energy"].max() < 2.1
    # The arm and its true energies are the same, to the round-off that a limit cycle makes grow.
    assert abs(paper.margin - port.margin) < 0.1


def test_a_loop_that_diverges_is_violated() -> None:
    """Without limits 24-fold per period: found at the first overdraft, three periods after the step."""
    run = ran(**PAPER)
    assert not run.failure  # the port tank's fallback catches it
    result = audit(run)
    assert result.verdict == "violated"
    assert result.time == pytest.approx(0.103, abs=1e-9)
    assert result.overdraft > 1000
    assert result.remedy == "see `passiflex limits` for the gains that hold at this rate"
    assert result.overdraft == -available_energy(run).min()


@pytest.mark.parametrize("delay", [0.0, PERIOD])
def test_a_loop_that_leaves_the_numbers_is_violated(delay: float, tmp_path: Path) -> None:
    """Energies up to 1e60 and more, or infinite ones: the verdict comes from before, and is not lost in them."""
    run = ran(**merged(PAPER, {"tank": {"kind": "paper"}, "control": {"delay": delay}}))
    assert run.failure.startswith("the state left the finite numbers 0.1")
    assert run.failure.endswith(" s after the start")
    assert run.time[-1] < 0.12
    result = audit(run)
    assert result.verdict == "violated"
    assert 0.1 < result.time < 0.107
    assert result.books_error > 1e3
    finite = Run(run.data.isel(time=run.time < result.time + PERIOD / 2))
    assert audit(Run.load(finite.save(tmp_path / "run.nc"))).verdict == "violated"


def test_a_run_that_ends_early_before_anything_happens_is_not_passive() -> None:
    """Cut before the overdraft, the same run says nothing."""
    run = ran(**merged(PAPER, {"tank": {"kind": "paper"}}))
    before = Run(run.data.isel(time=slice(0, 101)))
    assert audit(before).verdict == "violated"  # which its loop had noted
    result = audit(by_rows(before))
    assert result.verdict == "inconclusive"
    assert result.remedy == f"the run ended early: {run.failure}"


@pytest.mark.parametrize(
    "signal",
    ["joint_energy", "link_kinetic_energy", "external_energy", "shaped_kinetic_energy", "gravity_storage"],
)
@pytest.mark.parametrize("rows", [slice(300, 301), slice(300, None), slice(None)])
def test_a_number_that_is_none_is_never_passive(signal: str, rows: slice, tmp_path: Path) -> None:
    run = ran()
    data = run.data.copy(deep=True)
    values = data[signal].to_numpy().copy()
    values[rows] = np.nan
    data[signal] = data[signal].copy(data=values)
    assert audit(Run(data)).verdict != "passive"
    with pytest.raises(RunFileError, match=f"numbers that are not finite; got in {signal}"):
        Run.load(Run(data).save(tmp_path / "run.nc"))


def test_a_level_that_is_none_is_no_level() -> None:
    """The verdict is the port's; what the tank claims beyond that is then unknown, and not 0."""
    run = ran()
    data = by_rows(run).data.copy(deep=True)
    data["tank_energy"] = data["tank_energy"].where(data["time"] < 0.3)
    assert np.isnan(audit(Run(data)).books_error)


def test_every_joule_of_friction_is_in_the_robots_balance() -> None:
    run = ran(**random_scenario(1))
    data = run.data.copy(deep=True)
    late = np.where(run.time > 0.5, 1.0, 0.0)
    data["friction_energy"] = data["friction_energy"] + late
    change = robot_balance(Run(data)).residual - robot_balance(run).residual
    np.testing.assert_allclose(change, late, rtol=0, atol=1e-12)
    assert run["friction_energy"][-1] > 0.01


def test_a_saved_run_is_audited_alike(tmp_path: Path) -> None:
    for name, run in {"stable": ran(**random_scenario(0)), "active": ran(**PAPER)}.items():
        loaded = Run.load(run.save(tmp_path / f"{name}.nc"))
        one, other = audit(run), audit(loaded)
        for field in (
            "verdict",
            "time",
            "term",
            "margin",
            "integration_error",
            "books_error",
            "ledger_residual",
        ):
            assert getattr(one, field) == getattr(other, field)
        np.testing.assert_array_equal(books(loaded), books(run))
        assert loaded.sampled


def test_fewer_rows_tell_the_same_of_what_they_hold() -> None:
    """Energies are sums since the start: every fifth row has the same margin there, and no other verdict."""
    run = limit_cycle("paper")
    thin = run.every(5)
    np.testing.assert_array_equal(available_energy(thin), available_energy(run)[::5])
    assert audit(thin).verdict == audit(run).verdict
    assert audit(thin).books_error == pytest.approx(audit(run).books_error, rel=0.05)
