"""What noise that lasts credits a tank with: closed forms, draws, and what runs of the iiwa showed from outside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from passiflex.passivity import audit, overclaimed
from passiflex.sampled.measurement_bound import SIGMAS
from passiflex.scenarios.gain_settings import ShapedInertia
from passiflex.scenarios.scenario import Noise
from passiflex.simulation import resolve, simulate
from passiflex.stability.driven_loop import DrivenLoop
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.noise_credit import POSTURES, REACH, charged, mean_credit, noise_credit
from passiflex.studies import shipped_scenario
from worlds import PERIOD, merged, ran, world

LIGHT: dict[str, Any] = {"law": {"shaped_inertia": {"ratio": 0.1}}, "control": {"external_torque": "none"}}


def driven(A: np.ndarray, G: np.ndarray) -> DrivenLoop:
    n = G.shape[1]
    return DrivenLoop(A, G, np.zeros((n, len(A))), np.zeros((n, n)))


@pytest.mark.parametrize("lasting", [1, 2, 7])
def test_one_pole_has_a_closed_form(lasting: int) -> None:
    """q⁺ = a q − g n answers a held noise with −g (1 − aʲ) / (1 − a): the credit is half of that at L and at L − 1."""
    a, g, variance = 0.9, 1e-3, 0.3
    answers = [g * (1 - a**j) / (1 - a) for j in (lasting - 1, lasting)]
    expected = variance * sum(answers) / (2 * lasting)
    assert mean_credit([driven(np.array([[a]]), np.array([[-g]]))], 1, variance, lasting) == pytest.approx(
        expected
    )


def test_without_drawing_it_is_what_draws_have_on_average() -> None:
    """A random stable loop of six states and two joints under held noise: the mean of −½ (n_k + n_k+1)ᵀ Δq."""
    rng, lasting, blocks = np.random.default_rng(4), 5, 40_000
    A, G = rng.normal(size=(6, 6)), 1e-2 * rng.normal(size=(6, 2))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    noise = np.repeat(rng.normal(size=(blocks, 2)), lasting, axis=0)
    z = np.zeros((len(noise), 6))
    for k in range(len(noise) - 1):
        z[k + 1] = A @ z[k] + G @ noise[k]
    credited = -((noise[1:] + noise[:-1]) / 2 * np.diff(z[:, :2], axis=0)).sum(axis=1)
    drawn = credited[: len(credited) // lasting * lasting].reshape(-1, lasting).mean(axis=1)
    expected = mean_credit([driven(A, G)], 2, 1.0, lasting)
    assert abs(drawn.mean() - expected) < 4 * drawn.std() / np.sqrt(len(drawn))
    assert abs(expected) > 20 * drawn.std() / np.sqrt(len(drawn))


def test_an_answer_without_end_is_cut_at_its_reach() -> None:
    """A self-motion that drifts by v per period under a held noise: the credit stops to grow after 1 rad of it."""
    v = 1e-3
    loop = driven(np.array([[1.0]]), np.array([[-v]]))
    assert mean_credit([loop], 1, 1.0, 500) == pytest.approx(v * (500 + 499) / (2 * 500))
    assert mean_credit([loop], 1, 1.0, 100_000) == pytest.approx(REACH / 100_000, rel=1e-2)


@pytest.mark.parametrize(("hold", "joules"), [(0.005, 0.28), (0.010, 0.63), (0.020, 1.13), (0.050, 2.19)])
def test_it_is_what_an_idle_iiwa_was_credited_with_in_30_seconds(hold: float, joules: float) -> None:
    """0.2 (N m)² on each joint of Fig. 2's sampled arm; joules as nonlinear runs had them, measured from outside."""
    shipped = shipped_scenario("fig2_sampled")
    light = ShapedInertia(ratio=(0.03, 0.03, 0.031, 0.031, 0.035, 0.075, 0.081))  # the gains of those runs
    law = shipped.law.model_copy(update={"shaped_inertia": light})
    scenario = shipped.model_copy(update={"noise": Noise(torque_variance=0.2, hold=hold), "law": law})
    assert 30 * noise_credit(resolve(scenario)) == pytest.approx(joules, rel=0.08)


def test_a_nonlinear_run_is_credited_with_it() -> None:
    """The planar arm at rest, noise of 20 ms: what is claimed beyond the truth is the mean, to three deviations."""
    idle = merged(
        LIGHT, {"noise": {"torque_variance": 0.2, "hold": 0.02}, "reference": None, "duration": 60.0}
    )
    problem = resolve(world(**idle))
    expected = 60 * noise_credit(problem)
    assert expected > 1
    run = ran(**merged(idle, {"output_interval": 0.02}))
    deviation = (run["measurement_bound"][-1] - run["charged_energy"][-1]) / SIGMAS
    assert deviation < 0.1 * expected
    assert overclaimed(run)[-1] == pytest.approx(expected, abs=3 * deviation)
    assert run["charged_energy"][-1] == pytest.approx(POSTURES * expected, rel=1e-9)
    assert (overclaimed(run) <= run["measurement_bound"]).all()
    assert audit(run).verdict == "passive"


def test_white_noise_and_no_noise_are_charged_nothing() -> None:
    for noise in (None, {"torque_variance": 0.2, "hold": PERIOD}, {"torque_variance": 0.0, "hold": 0.02}):
        problem = resolve(world(**merged(LIGHT, {"noise": noise})))
        assert noise_credit(problem) == 0
        assert charged(problem) is problem


def test_it_goes_with_the_variance_and_is_that_of_the_worst_gains() -> None:
    noise = {"noise": {"torque_variance": 0.2, "hold": 0.01}}
    one = noise_credit(resolve(world(**merged(LIGHT, noise))))
    four = noise_credit(resolve(world(**merged(LIGHT, {"noise": {"torque_variance": 0.8, "hold": 0.01}}))))
    assert four == pytest.approx(4 * one, rel=1e-12)
    change = {
        "gains": [
            {"at": 0.3, "duration": 0.1, "stiffness": {"translation": 20}, "damping": {"translation": 5}}
        ]
    }
    other = {"law": {"stiffness": {"translation": 20}, "damping": {"translation": 5}}}
    soft = noise_credit(resolve(world(**merged(merged(LIGHT, noise), other))))
    both = noise_credit(resolve(world(**merged(merged(LIGHT, noise), change))))
    assert soft > 1.05 * one
    assert both == pytest.approx(soft, rel=1e-3)
    heavy = noise_credit(resolve(world(**merged(noise, {"law": {"shaped_inertia": {"ratio": 1.0}}}))))
    assert heavy < 0.2 * one


def test_an_offset_changes_nothing_of_it() -> None:
    """A constant is no part of the linear loop: the credit is the same, and the loop is still called stable."""
    noise = {"noise": {"torque_variance": 0.2, "hold": 0.01}}
    biased = merged(noise, {"sensors": {"torque_offset": [1.0, -1.0], "link_offset": 0.01}})
    assert noise_credit(resolve(world(**merged(LIGHT, biased)))) == pytest.approx(
        noise_credit(resolve(world(**merged(LIGHT, noise)))), rel=1e-6
    )
    assert LinearLoop(resolve(world(**merged(LIGHT, noise)))).spectrum().stable
    assert simulate(world(**merged(LIGHT, merged(biased, {"duration": 0.2})))).failure == ""
