"""How wrong the measured port energy may be by now: a bound that a controller books beside its tank's level.

Σw = Σ ½ (τ_a,k + τ_a,k+1)ᵀ (q_k+1 − q_k) is not ∫ τ_aᵀ q̇ dt. The bound E ≥ 0 [J] on ∫ τ_aᵀ q̇ dt − Σw, what a tank
claims beyond what is there, is the sum of

- the mean power with which noise that lasts credits the tank, times the time (`charged_energy`);
- `SIGMAS` standard deviations of what is random: noise, σ² Σ|½ (q_k+1 − q_k−1)|² if it is white; encoders of step ρ,
  ρ²/12 Σ|τ_k+1 − τ_k−1|², four times the variance of a uniform error; white noise ν of q, ν² Σ|½ (τ_k+1 − τ_k−1)|²
  and ν² |τ|² at both ends; and the bends b between readings;
- Σ b over gaps of missed periods, where b need not be random;
- `CURVED` times what a parabola through three readings adds to the trapezoids, if that is positive;
- Σ oᵢ |qᵢ − qᵢ,0| of a constant offset of τ_a within ±oᵢ: exact, and no more than the net displacement makes it;
- Σ sᵢ |Σwᵢ| of a scale error within ±sᵢ, joint by joint, and ½ρ (|τ_0| + |τ_k|) of the encoders at both ends;
- what a low-pass of the torque sensors withheld, which is known;
- for sensors that are late, what joints that went on as they did would have been given since then, `late` periods of
  it: a guess, as no reading knows of a kick before it comes. The rest of E bounds the claim at the instant last read.

The bend of a pair of readings is b = `BEND` (|δΔτ|ᵀ|Δq| + |Δτ|ᵀ|δΔq|), with δ the difference to the step before, less
what the noise explains: how far torque and way may have left their chords. Readings that are late by different times
are paired before anything is made of them (`Readings.pair`). Which errors there are is declared, by `error_layout`.
All else is measured, and nothing is known of motors, links or environment.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as cs

from passiflex.layout import Field, Layout
from passiflex.sampled.declared_errors import ErrorNumbers
from passiflex.sampled.readings import EXACT, Paired, Readings
from passiflex.sampled.sensors import UNFILTERED

SIGMAS = 5.0
"""Standard deviations that are booked: in a random walk exceeded once in some 10⁵ runs, at any time of them."""
EXPLAINED = 2.0
"""Standard deviations of a difference of readings that noise explains."""
BEND = 1 / 3
"""Four times the 1/12 of a parabola, as the next step may bend as much again, and more where a vibration grows."""
CURVED = 1.5
"""Vibrations of four periods per cycle curve that much more than parabolas do."""
GAP = 1.5
"""Periods from which on readings have a gap between them."""
SHORTEST = 1e-9
"""A time [s] below which nothing lasts."""
SMALLEST = 1e-200
"""A variance [J²] that is none."""


class Bound(NamedTuple):
    """What is booked in one period [J], and what is remembered of it.

    Attributes
    ----------
    total: E, which is subtracted from a level before anything is granted.
    lasting: E without what is guessed of the time since the instant that was read last: that guess comes and goes.
    lowered: By how much the declared errors of the sensors alone may have lowered a level since it last was
        sure. What readings hide between them, and what noise credits, lowers no level.
    state: The fields of `bound_state`, by name, but for those of `sure_state`.
    """

    total: cs.SX
    lasting: cs.SX
    lowered: cs.SX
    state: dict[str, Any]


def bound_state(n: int, readings: Readings = EXACT) -> Layout:
    """Return what is remembered from one period to the next."""
    noisy = (
        Field("storage_jitter", (), "J", "by how much noise on q and θ may have S read too low", kept=False),
        Field("debited_energy", (), "J", "by how much noise on q lowers the level on average", kept=False),
    )
    return readings.book_state(n) + Layout(
        (
            *noisy[: 2 * readings.noisy],
            Field("measurement_bound", (), "J", "E, most that Σ w may be short of the energy given so far"),
            Field("read_time", (), "s", "when the sensors were last read"),
            Field("charged_energy", (), "J", "its part for the mean credit of noise that lasts"),
            Field("walk", (), "J^2", "variance of what noise and encoders make of Σ w", kept=False),
            Field("bent", (), "J^2", "variance of the bends, as if they were random", kept=False),
            Field("unread_energy", (), "J", "Σ of the bends in gaps", kept=False),
            Field(
                "curved_energy", (), "J", "what parabolas add to the trapezoids, without the gaps", kept=False
            ),
            Field(
                "withheld_energy",
                (),
                "J",
                "Σ w with τ_a as before the sensors' low-pass, less Σ w",
                kept=False,
            ),
            Field("joint_work", (n,), "J", "Σ w of each joint, with τ_a as before the low-pass", kept=False),
            Field("first_q", (n,), "rad", "q of the first period", kept=False),
            Field("first_torque", (), "N m", "Σ|τ_a| of the first period", kept=False),
            Field("slow_q", (n,), "rad", "q, low-passed over the time that noise lasts", kept=False),
            Field("raw_tau_a", (n,), "N m", "τ_a of the last period as before the low-pass", kept=False),
            Field("step_q", (n,), "rad", "q of the last period less that of the one before", kept=False),
            Field("step_tau_a", (n,), "N m", "the same of τ_a as before the low-pass", kept=False),
            Field("step_time", (), "s", "time between the two", kept=False),
            Field("torque", (), "N m", "Σ|τ_a| of the last period"),
        )
    )


def sure_state(n: int, readings: Readings = EXACT) -> Layout:
    """Return what is remembered of the last period in which the level was sure: above the floor, with E subtracted."""
    known = {f.name: f for f in bound_state(n, readings)}
    names = ["measurement_bound", "walk", "withheld_energy", "joint_work", "torque"]
    names += ["storage_jitter", "debited_energy"] * readings.noisy
    fields = [known[name]._replace(name=f"sure_{name}", kept=True) for name in names]
    return Layout((*fields, Field("sure_q", (n,), "rad", "q")))


def booked_bound(
    y: Paired, elapsed: cs.SX, first: cs.SX, s: Any, e: ErrorNumbers, readings: Readings = EXACT
) -> Bound:
    """Return the bound after a reading `elapsed` seconds after the last one.

    `s` has the fields of `bound_state` and `sure_state`, and `last_q`, `last_tau_a` of the last period; `e`
    those of `error_layout`. `first` is 1 in the first period of all.
    """
    since = y.elapsed
    raw = _before_low_pass(y.tau_a, s.last_tau_a, since, e.torque_bandwidth)
    raw = cs.if_else(first, y.tau_a, raw)
    dq, dtau = cs.if_else(first, 0, y.q - s.last_q), cs.if_else(first, 0, raw - s.raw_tau_a)
    work = (raw + s.raw_tau_a) / 2 * dq
    bend, curve, gap = _between(dq, dtau, since, s, e, readings)
    random = e.noise_deviation**2 * _way_of_noise(y.q, dq, since, s, e)
    random += e.link_resolution**2 / 12 * cs.sumsqr(dtau + s.step_tau_a)
    if readings.noisy:
        random += e.link_deviation**2 * cs.sumsqr((dtau + s.step_tau_a) / 2)
    withheld = s.withheld_energy + cs.sum1(work) - cs.dot(y.tau_a + s.last_tau_a, dq) / 2
    start, torque = cs.if_else(first, y.q, s.first_q), cs.norm_1(raw)
    state = {
        "read_time": cs.if_else(first, 0, s.read_time + elapsed),
        "charged_energy": s.charged_energy + cs.if_else(first, 0, e.noise_credit * elapsed),
        "walk": s.walk + cs.if_else(first, 0, random),
        "bent": s.bent + bend**2,
        "unread_energy": s.unread_energy + cs.if_else(gap, bend, 0),
        "curved_energy": s.curved_energy + cs.if_else(gap, 0, curve),
        "withheld_energy": cs.if_else(first, 0, withheld),
        "joint_work": s.joint_work + work,
        "first_q": start,
        "first_torque": cs.if_else(first, torque, s.first_torque),
        "slow_q": cs.if_else(first, y.q, y.q + (s.slow_q - y.q) * _kept(since, e)),
        "raw_tau_a": raw,
        "step_q": dq,
        "step_tau_a": dtau,
        "step_time": since,
        "torque": torque,
        **y.state,
    }
    if readings.noisy:
        state["debited_energy"] = s.debited_energy + cs.if_else(first, 0, e.noise_debit * elapsed)
    r = SimpleNamespace(**state)
    least = 1 - cs.mmax(e.torque_scale)  # a torque may be read this share of its size
    constant = _constant(y.q - start, r.joint_work, r.first_torque + torque, e)
    hidden = r.unread_energy + CURVED * cs.fmax(r.curved_energy, 0) + r.charged_energy
    begun = e.noise_deviation**2 * cs.if_else(e.noise_hold < GAP * e.period, 0, cs.sumsqr(y.q - r.slow_q))
    ends, sure_ends = cs.SX(0), cs.SX(0)
    if readings.noisy:
        ends, sure_ends = (
            e.link_deviation**2 * (cs.sumsqr(raw) + t**2) for t in (r.first_torque, s.sure_torque)
        )
    passing = _meanwhile(dq, dtau, since, s, e) if readings.late else cs.SX(0)
    hidden += passing
    random = SIGMAS * _root(r.walk + begun + r.bent + ends)
    total = (constant + random + hidden + cs.fmax(r.withheld_energy, 0)) / least
    constant = _constant(y.q - s.sure_q, r.joint_work - s.sure_joint_work, s.sure_torque + torque, e)
    walked = SIGMAS * _root(cs.fmax(r.walk - s.sure_walk, 0) + 2 * begun + sure_ends)
    lowered = (constant + walked + cs.fmax(s.sure_withheld_energy - r.withheld_energy, 0)) / least
    lowered += passing  # where S was read before what it gave or took
    if readings.noisy:
        lowered += r.debited_energy - s.sure_debited_energy
    return Bound(total, total - passing / least, lowered, {"measurement_bound": total} | state)


def sure(now: cs.SX, q: cs.SX, s: Any, state: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of `sure_state`: those of this period, with the reading q, if `now` is 1."""
    known = state | {"q": q}
    names = (name for name in vars(s) if name.startswith("sure_"))
    return {name: cs.if_else(now, known[name.removeprefix("sure_")], getattr(s, name)) for name in names}


def jitter(quadratic: cs.SX, e: ErrorNumbers) -> cs.SX:
    """Return by how much S may be read too low for the noise on q and θ [J].

    Where S is ½ zᵀ H z, noise n of z adds zᵀ H n + ½ nᵀ H n. The first has the variance zᵀ H C H z ≤ 2 λ S with
    λ the largest eigenvalue of C H, C the noise's covariance. The second is never negative.
    """
    return SIGMAS * _root(2 * e.jitter_share * quadratic)


def _constant(moved: cs.SX, work: cs.SX, torques: cs.SX, e: ErrorNumbers) -> cs.SX:
    """Return what offset, scale and the encoders' steps at both ends are worth over a displacement [J]."""
    steps = e.link_resolution / 2 * torques
    return cs.dot(e.torque_offset, cs.fabs(moved)) + cs.dot(e.torque_scale, cs.fabs(work)) + steps


def _root(variance: cs.SX) -> cs.SX:
    """Return the square root, with a slope at 0 that is finite."""
    return cs.sqrt(cs.fmax(variance, SMALLEST)) - math.sqrt(SMALLEST)


def _before_low_pass(tau: cs.SX, last: cs.SX, elapsed: cs.SX, bandwidth: cs.SX) -> cs.SX:
    """Return what went into `sensors.low_pass` since the last reading."""
    lag = cs.if_else(bandwidth < UNFILTERED, 1 / (cs.exp(bandwidth * elapsed) - 1), 0)
    return tau + lag * (tau - last)


def _kept(elapsed: cs.SX, e: ErrorNumbers) -> cs.SX:
    """Return what share of its distance to q the slow q keeps, so that `_way_of_noise` is right for a steady motion."""
    return cs.exp(-cs.sqrt(2) * elapsed / cs.fmax(e.noise_hold, SHORTEST))


def _way_of_noise(q: cs.SX, dq: cs.SX, elapsed: cs.SX, s: Any, e: ErrorNumbers) -> cs.SX:
    """Return what the variance of the noise's part in Σw grows by, per variance of the noise [rad²].

    By parts the noise of a reading multiplies ½ (q_k+1 − q_k−1). Noise that lasts multiplies the way in that
    time, once in it: 2 |q − slow q|² Δt / hold is that for a steady motion, and half of it for a vibration.
    """
    hold = cs.fmax(e.noise_hold, SHORTEST)
    centred = cs.sumsqr((dq + s.step_q) / 2)
    lasting = 2 * cs.sumsqr(q - s.slow_q) * elapsed / hold
    return cs.if_else(hold < GAP * elapsed, centred, cs.fmax(lasting, centred))


def _between(
    dq: cs.SX, dtau: cs.SX, elapsed: cs.SX, s: Any, e: ErrorNumbers, readings: Readings
) -> tuple[cs.SX, cs.SX, cs.SX]:
    """Return bend [J] and parabola less trapezoid [J] of two readings, and whether there was a gap between them."""
    known = s.step_time > 0
    ratio = cs.if_else(known, elapsed / cs.fmax(s.step_time, SHORTEST), 0)
    noise = EXPLAINED * e.noise_deviation
    bend_tau = cs.fmax(cs.fabs(dtau - ratio * s.step_tau_a) - noise * cs.sqrt(2 * (1 + ratio + ratio**2)), 0)
    bend_q, way = cs.fabs(dq - ratio * s.step_q) - e.link_resolution * (1 + ratio), cs.fabs(dq)
    if readings.noisy:
        explained = EXPLAINED * e.link_deviation
        bend_q -= explained * cs.sqrt(2 * (1 + ratio + ratio**2))
        way = cs.fmax(way - explained * cs.sqrt(2), 0)
    bend_q = cs.fmax(bend_q, 0)
    seen = cs.fmax(cs.fabs(dtau) - noise * cs.sqrt(2), 0)
    bend = e.bend * (cs.dot(bend_tau, way) + cs.dot(seen, bend_q))
    curve = e.bend / 4 * (cs.dot(s.step_tau_a, dq) - cs.dot(dtau, s.step_q))
    late = (1 + SHORTEST if readings.late else GAP) * e.period  # between two readings a gap may be shared out
    return bend, cs.if_else(s.step_time < late, curve, 0), elapsed > late


def _meanwhile(dq: cs.SX, dtau: cs.SX, elapsed: cs.SX, s: Any, e: ErrorNumbers) -> cs.SX:
    """Return what the joints may have been given since the instant that was read last [J].

    Joint by joint Σ_j (|τ| + j |Δτ|) (|Δq| + j |δΔq|) over j = 1 … `late` periods, less what noise and steps explain.
    """
    ratio = cs.if_else(s.step_time > 0, elapsed / cs.fmax(s.step_time, SHORTEST), 0)
    steps = EXPLAINED * cs.sqrt(2) * e.link_deviation + e.link_resolution
    noise = EXPLAINED * cs.sqrt(2) * e.noise_deviation
    way = cs.fmax(cs.fabs(dq) - steps, 0)
    more = cs.fmax(cs.fabs(dq - ratio * s.step_q) - steps * cs.sqrt(1 + ratio + ratio**2), 0)
    rise, torque, m = cs.fmax(cs.fabs(dtau) - noise, 0), cs.fabs(s.raw_tau_a + dtau), e.late
    once, twice = m * (m + 1) / 2, m * (m + 1) * (2 * m + 1) / 6
    return (
        m * cs.dot(torque, way)
        + once * (cs.dot(torque, more) + cs.dot(rise, way))
        + twice * cs.dot(rise, more)
    )
