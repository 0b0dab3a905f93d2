"""How wrong the measured port energy may be by now: a bound that a controller books beside its tank's level.

Σw = Σ ½ (τ_a,k + τ_a,k+1)ᵀ (q_k+1 − q_k) is not ∫ τ_aᵀ q̇ dt. The bound E ≥ 0 [J] on ∫ τ_aᵀ q̇ dt − Σw, what a tank
claims beyond what is there, is the sum of

- the mean power with which noise that lasts credits the tank, times the time (`charged_energy`);
- `SIGMAS` standard deviations of the random walk that noise makes of Σw: σ √Σ|½ (q_k+1 − q_k−1)|² if it is white;
- Σ oᵢ |qᵢ − qᵢ,0| of a constant offset of τ_a within ±oᵢ: exact, and no more than the net displacement makes it;
- Σ sᵢ |Σwᵢ| of a scale error within ±sᵢ, joint by joint;
- ½ρ (|τ_0| + |τ_k|) + Σ ¼ρ |τ_k+1 − τ_k−1| of encoders with the step ρ, by summation by parts;
- `BEND` (|δΔτ|ᵀ|Δq| + |Δτ|ᵀ|δΔq|) of each pair of readings, with δ the difference to the step before: how far
  torque and way may have left the trapezoid's chord in between. Long gaps after missed periods count by the same law;
- what a low-pass of the torque sensor withheld, which is known.

Differences of readings that the noise explains count as random, not as facts. Which errors there are is
declared, by `error_layout`. All else is measured, and nothing is known of motors, links or surroundings.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as cs

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout
from passiflex.sampled.sensors import UNFILTERED

SIGMAS = 5.0
"""Standard deviations of the random walk that are booked: exceeded once in some 10⁵ runs, at any time of them."""
EXPLAINED = 3.0
"""Standard deviations of a difference of readings that noise explains."""
BEND = 0.25
"""Share of the torque's bend times the way: 1/12 for a parabola; the largest seen of vibrations is 0.23."""

SHORTEST = 1e-9
"""A time [s] below which nothing lasts."""


class Bound(NamedTuple):
    """What is booked in one period [J], and what is remembered of it.

    Attributes
    ----------
    total: E, which is subtracted from a level before anything is granted.
    explained: By how much the declared errors of the sensors may have made a level too low: what readings
        hide between them and what noise credits are not in it.
    state: The fields of `bound_state`, by name.
    """

    total: cs.SX
    explained: cs.SX
    state: dict[str, Any]


def error_layout(n: int) -> Layout:
    """Return the declared errors of the measurement; 0 stands for none, `UNFILTERED` for no low-pass."""
    return Layout(
        (
            Field("torque_offset", (n,), "N m", "largest constant error of τ_a, ≥ 0"),
            Field("torque_scale", (n,), "1", "largest relative error of τ_a, 0 to 1/2"),
            Field("torque_bandwidth", (), "rad/s", "pole of the torque sensors"),
            Field("link_resolution", (), "rad", "step of q"),
            Field("noise_deviation", (), "N m", "standard deviation of the noise on τ_a"),
            Field("noise_hold", (), "s", "how long a sample of the noise lasts"),
            Field("noise_credit", (), "W", "mean power with which it credits the tank"),
            Field("bend", (), "1", "share of bend times way that is booked, `BEND`; 0 trusts the trapezoid"),
        )
    )


def bound_state(n: int) -> Layout:
    """Return what is remembered from one period to the next."""
    return Layout(
        (
            Field("measurement_bound", (), "J", "E, most that Σ w may be short of the energy given so far"),
            Field("charged_energy", (), "J", "its part for the mean credit of noise that lasts"),
            Field("noise_walk", (), "J^2", "variance of the noise's part in Σ w"),
            Field("hidden_energy", (), "J", "its part for what happens between readings and within a step"),
            Field("withheld_energy", (), "J", "Σ w with τ_a as before the sensors' low-pass, less Σ w"),
            Field("joint_work", (n,), "J", "Σ w of each joint, with τ_a as before the low-pass"),
            Field("first_q", (n,), "rad", "q of the first period"),
            Field("slow_q", (n,), "rad", "q, low-passed over the time that noise lasts"),
            Field("raw_tau_a", (n,), "N m", "τ_a of the last period as before the low-pass"),
            Field("step_q", (n,), "rad", "q of the last period less that of the one before"),
            Field("step_tau_a", (n,), "N m", "the same of τ_a as before the low-pass"),
            Field("step_time", (), "s", "time between the two"),
        )
    )


def booked_bound(
    y: Measurement, elapsed: cs.SX, first: cs.SX, s: SimpleNamespace, e: SimpleNamespace
) -> Bound:
    """Return the bound after a reading `elapsed` seconds after the last one.

    `s` has the fields of `bound_state`, and `last_q`, `last_tau_a` of the last period; `e` those of
    `error_layout`. `first` is 1 in the first period of all.
    """
    raw = _before_low_pass(y.tau_a, s.last_tau_a, elapsed, e.torque_bandwidth)
    raw = cs.if_else(first, y.tau_a, raw)
    dq, dtau = cs.if_else(first, 0, y.q - s.last_q), cs.if_else(first, 0, raw - s.raw_tau_a)
    work = (raw + s.raw_tau_a) / 2 * dq
    hidden, by_chance = _between(dq, dtau, elapsed, s, e)
    walked = _walk(y.q, dq, elapsed, s, e) + by_chance
    withheld = s.withheld_energy + cs.sum1(work) - cs.dot(y.tau_a + s.last_tau_a, dq) / 2
    withheld = cs.if_else(first, 0, withheld)
    start = cs.if_else(first, y.q, s.first_q)
    slowness = cs.fmax(e.noise_hold, SHORTEST) / cs.sqrt(2)  # so that `_walk` is right for a steady motion
    last = e.link_resolution / 2 * cs.norm_1(raw)
    state = {
        "charged_energy": s.charged_energy + cs.if_else(first, 0, e.noise_credit * elapsed),
        "noise_walk": s.noise_walk + cs.if_else(first, 0, walked),
        "hidden_energy": s.hidden_energy + cs.if_else(first, last, hidden),
        "withheld_energy": withheld,
        "joint_work": s.joint_work + work,
        "first_q": start,
        "slow_q": cs.if_else(first, y.q, y.q + (s.slow_q - y.q) * cs.exp(-elapsed / slowness)),
        "raw_tau_a": raw,
        "step_q": dq,
        "step_tau_a": dtau,
        "step_time": elapsed,
    }
    known = (
        SIGMAS * cs.sqrt(state["noise_walk"])
        + cs.dot(e.torque_offset, cs.fabs(y.q - start))
        + cs.dot(e.torque_scale, cs.fabs(state["joint_work"]))
    )
    doubt = state["charged_energy"] + state["hidden_energy"] + last + cs.fmax(withheld, 0)
    smallest = 1 - cs.mmax(e.torque_scale)  # a torque may be read this share of its size
    total = (known + doubt) / smallest
    explained = (known + cs.fmax(-withheld, 0)) / smallest
    return Bound(total, explained, {"measurement_bound": total} | state)


def _before_low_pass(tau: cs.SX, last: cs.SX, elapsed: cs.SX, bandwidth: cs.SX) -> cs.SX:
    """Return what went into `sensors.low_pass` since the last reading."""
    lag = cs.if_else(bandwidth < UNFILTERED, 1 / cs.expm1(bandwidth * elapsed), 0)
    return tau + lag * (tau - last)


def _walk(q: cs.SX, dq: cs.SX, elapsed: cs.SX, s: SimpleNamespace, e: SimpleNamespace) -> cs.SX:
    """Return what the variance of the noise's part in Σw grows by [J²]."""
    hold = cs.fmax(e.noise_hold, SHORTEST)
    centred = cs.sumsqr((dq + s.step_q) / 2)
    lasting = 2 * cs.sumsqr(q - s.slow_q) * elapsed / hold
    return e.noise_deviation**2 * cs.if_else(hold < 1.5 * elapsed, centred, cs.fmax(lasting, centred))


def _between(
    dq: cs.SX, dtau: cs.SX, elapsed: cs.SX, s: SimpleNamespace, e: SimpleNamespace
) -> tuple[cs.SX, cs.SX]:
    """Return the most that happened unseen between two readings and within the encoders' steps [J].

    The first is a fact; the second, a variance [J²], is what differences of torque within the noise make of
    the encoders' steps.
    """
    ratio = elapsed / cs.fmax(s.step_time, SHORTEST)
    ratio = cs.if_else(s.step_time > 0, ratio, 0)
    noise = EXPLAINED * e.noise_deviation
    bend_tau = cs.fmax(cs.fabs(dtau - ratio * s.step_tau_a) - noise * cs.sqrt(2 * (1 + ratio + ratio**2)), 0)
    bend_q = cs.fmax(cs.fabs(dq - ratio * s.step_q) - e.link_resolution * (1 + ratio), 0)
    seen = cs.fmax(cs.fabs(dtau) - noise * cs.sqrt(2), 0)
    two, noise_of_two = cs.fabs(dtau + s.step_tau_a), noise * cs.sqrt(2)
    stepped = e.link_resolution / 4 * cs.sum1(cs.fmax(two - noise_of_two, 0))
    by_chance = e.link_resolution**2 / 48 * cs.sumsqr(cs.fmin(two, noise_of_two))
    return e.bend * (cs.dot(bend_tau, cs.fabs(dq)) + cs.dot(seen, bend_q)) + stepped, by_chance
