"""White noise on the readings of q and θ: drawn apart from all other chance, booked, and no reason to fall back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from passiflex.errors import ScenarioError
from passiflex.loops.sampled_loop import SampledLoop
from passiflex.passivity import audit, overclaimed
from passiflex.problems.unbooked import unbooked
from passiflex.sampled.measurement_bound import SIGMAS
from passiflex.simulation import resolve, simulate_problem
from passiflex.simulation.batch import simulate_batch
from passiflex.simulation.book_cautions import book_cautions
from passiflex.simulation.schedule import Chance
from passiflex.stability.noise_credit import POSTURES, charged, noise_credit, noise_powers
from passiflex.stability.storage_jitter import storage_jitter
from worlds import PERIOD, books, merged, ran, same, world

NOISE: dict[str, Any] = {"noise": {"link_deviation": 1e-5, "motor_deviation": 2e-5}}
BUSY = {
    "noise": {"torque_variance": 0.1, "hold": 2e-3, "link_deviation": 1e-5, "motor_deviation": 1e-5},
    "sensors": {"velocity": "differences", "velocity_filter": 200},
    "control": {"jitter": 0.2e-3, "missed": 0.1},
}


def drawn(changes: dict[str, Any], *chunks: int) -> dict[str, np.ndarray]:
    problem = resolve(world(**changes))
    row = SampledLoop(problem.controller, problem.elements).period
    chance, first, parts, timing = Chance(problem, row), 0, [], []
    for count in chunks:
        found, when = chance.take(first, count)
        parts.append(found)
        timing.append(when)
        first += count
    return row.drawn.unpack(np.vstack(parts)) | {"timing": np.vstack(timing)}


def test_it_has_streams_of_its_own() -> None:
    """Noise of τ_a, jitter and missed periods stay to the last bit; each sample is drawn once, in whatever chunks."""
    without = merged(BUSY, {"noise": {"link_deviation": None, "motor_deviation": None}})
    one, other = drawn(BUSY, 300), drawn(without, 300)
    assert "link_noise" not in other
    for name in ("torque_noise", "elapsed", "timing"):
        np.testing.assert_array_equal(one[name], other[name])
    again = drawn(BUSY, 7, 200, 93)
    for name, values in one.items():
        np.testing.assert_array_equal(values, again[name])
    link, motor = one["link_noise"], one["motor_noise"]
    assert np.abs(np.corrcoef(np.hstack([link, motor, one["torque_noise"]]).T) - np.eye(6)).max() < 0.25
    low, high = stats.chi2.ppf([1e-6, 1 - 1e-6], link.size)
    assert low < (link**2).sum() / 1e-10 < high
    half = drawn(merged(BUSY, {"noise": {"link_deviation": 0.0}}), 300)
    assert not half["link_noise"].any()
    np.testing.assert_array_equal(half["motor_noise"], motor)


def test_the_sensors_read_it_in_a_run() -> None:
    run, noise = ran(**NOISE, duration=0.15), drawn(NOISE, 151)
    np.testing.assert_allclose(run["measured_q"] - run["q"], noise["link_noise"], rtol=0, atol=1e-15)
    np.testing.assert_allclose(run["measured_theta"] - run["theta"], noise["motor_noise"], rtol=0, atol=1e-15)
    assert run.scenario is not None
    assert same(simulate_problem(resolve(run.scenario)), run)


@pytest.mark.slow
def test_a_lane_reads_the_same() -> None:
    """With sensors that are late too, as lanes of this structure take a while to compile."""
    changes = merged(BUSY, {"sensors": {"torque_delay": 1.5e-3}, "law": {"shaped_inertia": {"ratio": 1.0}}})
    problems = [resolve(world(**changes, seed=seed)) for seed in range(3)]
    keep = ["measured_q", "measured_tau_a", "tank_energy", "measurement_bound"]
    for problem, lane in zip(problems, simulate_batch(problems, keep), strict=True):
        alone = simulate_problem(problem)
        for name in keep:
            np.testing.assert_allclose(lane[name], alone[name], rtol=0, atol=1e-9)


def test_none_of_it_is_as_if_it_were_not_there() -> None:
    """Of deviations 0 no code is made."""
    none = {"noise": {"torque_variance": 0.25, "link_deviation": 0.0, "motor_deviation": 0.0}}
    assert same(ran(**none), ran(noise={"torque_variance": 0.25}))
    assert not resolve(world(**none)).controller.readings.noisy


def test_the_books_close_and_their_gap_is_a_walk_over_the_torque() -> None:
    """∫ τ_aᵀ dq − Σw is Σ ½ (τ_k+1 − τ_k−1)ᵀ n_k and the two ends: 12 seeds are within the 99.8 % of χ², below E.

    The law answers noise on q here (K_e = 1.5 K), a period late, so that there is no mean.
    """
    changes: dict[str, Any] = {
        "noise": {"link_deviation": 2e-5},
        "control": {"delay": PERIOD},
        "law": {"shaped_stiffness": {"ratio": 1.5}, "shaped_inertia": {"ratio": 1.0}},
    }
    scores = []
    for seed in range(12):
        run = ran(**changes, seed=seed)
        np.testing.assert_allclose(books(run), books(run)[0], rtol=0, atol=1e-13)
        a = (run["tau_a"][1:] + run["tau_a"][:-1]) / 2
        trapezoid = (a * np.diff(run["q"], axis=0)).sum()
        square = (a[0] ** 2).sum() + (a[-1] ** 2).sum() + (np.diff(a, axis=0) ** 2).sum()
        scores.append((trapezoid - run["measured_port_energy"][-1]) / (2e-5 * np.sqrt(square)))
        assert (overclaimed(run) <= run["measurement_bound"]).all()
        assert audit(run).verdict == "passive"
    low, high = stats.chi2.ppf([1e-3, 1 - 1e-3], 12)
    assert low < np.square(scores).sum() < high
    assert abs(np.mean(scores)) < stats.norm.isf(1e-3) / np.sqrt(12)


IDLE: dict[str, Any] = {
    "reference": [],
    "tank": {"initial": 5},
    "duration": 20.0,
    "output_interval": 0.02,
    "noise": {"link_deviation": 5e-5},
    "sensors": {"velocity": "differences"},
    "control": {"external_torque": "none"},
}


@pytest.mark.parametrize(
    ("stiffness", "inertia", "delay", "sign"),
    [(3.0, 0.5, 0.0, -1), (0.5, 1.0, 0.0, 1), (0.5, 1.5, 0.3e-3, 1), (1.5, 1.0, 0.4e-3, -1)],
)
def test_the_mean_is_that_of_the_linear_loop(
    stiffness: float, inertia: float, delay: float, sign: int
) -> None:
    """½ σ² tr(∂τ_k+1/∂n_k) a period, given or taken: a nonlinear arm at rest has it, to three deviations and 2 %."""
    law = {"shaped_stiffness": {"ratio": stiffness}, "shaped_inertia": {"ratio": inertia}}
    problem = resolve(world(**merged(IDLE, {"law": law, "control": {"delay": delay}})))
    expected = 20 * noise_powers(problem)[0]
    run = simulate_problem(problem)
    deviation = (run["measurement_bound"][-1] - run["charged_energy"][-1]) / SIGMAS
    assert overclaimed(run)[-1] == pytest.approx(expected, rel=0.02, abs=3 * deviation)
    assert np.sign(expected) == sign
    assert abs(expected) > 5 * deviation
    errors = problem.parts.unpack("errors", charged(problem).numbers)
    declared = errors["noise_credit"] if sign > 0 else errors["noise_debit"]
    assert 20 * declared == pytest.approx(
        POSTURES * abs(expected), rel=0.3
    )  # or the fallback's, if that has more
    assert (overclaimed(run) <= run["measurement_bound"]).all()


def test_a_command_that_comes_a_period_later_meets_no_noise_of_its_own() -> None:
    late = merged(IDLE, {"control": {"delay": PERIOD}, "law": {"shaped_inertia": {"ratio": 1.0}}})
    assert noise_credit(resolve(world(**late))) == 0
    read_late = merged(IDLE, {"sensors": {"link_delay": PERIOD}, "law": {"shaped_inertia": {"ratio": 1.0}}})
    assert noise_powers(resolve(world(**read_late))) == []


def test_the_jitter_of_the_storage_has_a_closed_form() -> None:
    """At rest with true velocities only the springs move: H is K_e of the joints, and K_x is next to nothing here."""
    deviation = 1e-5
    problem = resolve(world(noise={"motor_deviation": deviation}, law={"stiffness": {"translation": 1e-3}}))
    K = problem.law.robot.layout.unpack(problem.model)["joint_stiffness"]  # K_e = K: φ = θ
    found = storage_jitter(problem)
    assert found.share == pytest.approx(deviation**2 * K.max(), rel=1e-4)
    trace = deviation**2 * K.sum()
    tail = (trace + 2 * np.sqrt(15 * found.share * trace) + 30 * found.share) / 2
    assert found.mean == pytest.approx(tail, rel=1e-4)
    draws = np.random.default_rng(0).normal(0, deviation, (100_000, K.size))
    assert ((K * draws**2).sum(axis=1) / 2 < found.mean).all()


def test_it_is_said_to_be_none_of_the_laws_books() -> None:
    assert unbooked(resolve(world(**NOISE))) == "sampling and noise"


def test_it_needs_sensors_that_are_read() -> None:
    with pytest.raises(ScenarioError) as refused:
        world(
            control=None,
            tank=None,
            noise={"torque_variance": 0.1, "link_deviation": 1e-5, "motor_deviation": 1},
        )
    found = [line.split(", ", 2)[2] for line in str(refused.value).splitlines()[1:]]
    needs = "needs `control`: in continuous time nothing is read"
    assert found == [f"noise.link_deviation: {needs}", f"noise.motor_deviation: {needs}"]
    with pytest.raises(
        ScenarioError, match=r"noise.torque_variance: missing: variance per joint, \(N m\)\^2; or link_de"
    ):
        world(noise={"hold": 1e-3})


def test_a_storage_that_shakes_more_than_the_floor_bears_is_said_before_the_run() -> None:
    changes = {"noise": {"motor_deviation": 5e-5}, "sensors": {"velocity": "differences"}}
    (line,) = book_cautions(resolve(world(**changes)))
    assert line.startswith("noise on the positions shakes the storage that the tank reads, by up to ")
    assert "; try sensors.velocity_filter: " in line
    frequency = float(line.split("velocity_filter: ")[1].split()[0])
    assert book_cautions(resolve(world(**merged(changes, {"sensors": {"velocity_filter": frequency}})))) == ()
    assert book_cautions(resolve(world(**NOISE))) == ()


AT_ITS_FLOOR: dict[str, Any] = {
    "control": {"external_torque": "none"},
    "tank": {"initial": 0.2},
    "reference": [
        {"at": 0.1, "kind": "circle", "plane": ["x", "z"], "radius": 0.1, "period": 1.5},
        {"at": 4.0, "kind": "hold"},
    ],
    "duration": 100.0,
    "output_interval": 0.01,
    "law": {"shaped_inertia": {"ratio": 0.5}},
}


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [1.0, 3.0])
@pytest.mark.parametrize("deviation", [1e-6, 1e-5, 3e-5])
def test_a_sound_loop_that_rests_at_its_floor_is_not_latched(deviation: float, stiffness: float) -> None:
    """100 s at rest, velocities from differences, low-passed or not, noise of τ_a as well."""
    for seed, pole in ((0, 100.0), (1, "inf Hz")):
        run = ran(
            **merged(
                AT_ITS_FLOOR,
                {
                    "noise": {
                        "link_deviation": deviation,
                        "motor_deviation": deviation,
                        "torque_variance": 0.05,
                    },
                    "sensors": {"velocity": "differences", "velocity_filter": pole},
                    "law": {"shaped_stiffness": {"ratio": stiffness}},
                    "seed": seed,
                },
            )
        )
        assert not run["latched"].any()
        assert run["tank_energy"].min() < 0.15
        assert (overclaimed(run) <= run["measurement_bound"] + 1e-9).all()
        assert audit(run).verdict == "passive"
