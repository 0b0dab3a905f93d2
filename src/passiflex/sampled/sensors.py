"""What a robot's sensors make of the truth: scale, offset, noise, bandwidth, resolution, differences, delay."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import casadi as cs
import numpy as np

from passiflex.control.signals import Measurement
from passiflex.layout import Field, Layout
from passiflex.sampled.readings import EXACT, Readings, delayed
from passiflex.sampled.rest import Remembered, Rest

UNFILTERED = 1e9
"""A bandwidth [rad/s] that stands for none."""


def quantised(value: cs.SX, resolution: cs.SX) -> cs.SX:
    """Return the nearest multiple of the resolution; the value itself if the resolution is 0."""
    step = cs.if_else(resolution > 0, resolution, 1)
    return cs.if_else(resolution > 0, step * cs.floor(value / step + 0.5), value)


def low_pass(last: cs.SX, value: cs.SX, bandwidth: cs.SX, elapsed: cs.SX) -> cs.SX:
    """Return a first-order low-pass of pole `bandwidth` [rad/s], exact for a value held since the last sample."""
    return cs.if_else(
        bandwidth < UNFILTERED, last + (1 - cs.exp(-bandwidth * elapsed)) * (value - last), value
    )


def difference(last: cs.SX, value: cs.SX, elapsed: cs.SX) -> cs.SX:
    """Return (value − last) / elapsed: the mean velocity of the last period, half a period late."""
    return (value - last) / elapsed


class Reading(NamedTuple):
    """What the sensors say, and what they remember."""

    measured: Measurement
    state: cs.SX


class SensorNumbers(Protocol):
    """The numbers of the sensors in symbols, as `Sensors.layout` says."""

    torque_scale: cs.SX
    torque_offset: cs.SX
    link_offset: cs.SX
    motor_offset: cs.SX
    link_resolution: cs.SX
    motor_resolution: cs.SX
    velocity_differences: cs.SX
    velocity_bandwidth: cs.SX
    torque_bandwidth: cs.SX
    wrench_bandwidth: cs.SX
    link_late: cs.SX
    motor_late: cs.SX
    torque_late: cs.SX
    wrench_late: cs.SX


class Noise(NamedTuple):
    """What is added to τ_a, q and θ in one period (n,); 0 where nothing is."""

    torque: cs.SX
    link: cs.SX | float = 0.0
    motor: cs.SX | float = 0.0


class AbstractSensorEffect(abc.ABC):
    """What else the readings go through, in their order, as a dead zone or a bias that drifts.

    Its numbers are attributes of its own. What the books of a tank know of the sensors' errors they do not know of it.
    """

    def state(self, n: int) -> Layout:
        """Return what is remembered from one sample to the next.

        A field that depends on the readings and acts on the command says so (`acts`), or the judge of stability does
        not see it; one that goes its own way, as a drift, does not.
        """
        return Layout(())

    def start(self, at: Rest) -> Remembered:
        """Return what is remembered at rest; zeros for most."""
        return self.state(at.q.size).zeros()

    @abc.abstractmethod
    def read(self, y: Measurement, elapsed: cs.SX, s: Any) -> Reading:
        """Return the reading of y, `elapsed` seconds after the last one."""


@dataclass(frozen=True)
class Sensors:
    """The sensors of one robot, in this order: scale, offset, noise, bandwidth, resolution, velocities, delay.

    Then `effects` of somebody's own. `readings` says which of them have noise or are late.

    All numbers are parameters: 0 switches a scale error, an offset or a resolution off, `UNFILTERED` a
    bandwidth, and `velocity_differences` 0 gives the true velocities. Scale and offset stay what they are
    for the whole run. A sensor that is late hands out, in each period in which the law runs, what it read so many
    such periods ago, linear between two of them. Nothing here knows what the law does.
    """

    n: int
    effects: tuple[AbstractSensorEffect, ...] = ()
    readings: Readings = EXACT

    @property
    def layout(self) -> Layout:
        """Return the parameters."""
        n = self.n
        return Layout(
            (
                Field("torque_scale", (n,), "1", "τ_a is read 1 + this times as large"),
                Field("torque_offset", (n,), "N m", "and this much higher"),
                Field("link_offset", (n,), "rad", "q is read this much higher"),
                Field("motor_offset", (n,), "rad", "θ is read this much higher"),
                Field("link_resolution", (), "rad", "of q"),
                Field("motor_resolution", (), "rad", "of θ"),
                Field("velocity_differences", (), "1", "1: q̇, θ̇ are differences of readings; 0: true"),
                Field("velocity_bandwidth", (), "rad/s", "pole of the low-pass of the differences"),
                Field("torque_bandwidth", (), "rad/s", "pole of the joint torque sensor"),
                Field("wrench_bandwidth", (), "rad/s", "pole of the wrench sensor"),
                Field("link_late", (), "1", "periods by which q and q̇ are late"),
                Field("motor_late", (), "1", "the same of θ and θ̇"),
                Field("torque_late", (), "1", "the same of τ_a"),
                Field("wrench_late", (), "1", "the same of F_e"),
            ),
            SensorNumbers,
        )

    @property
    def state(self) -> Layout:
        """Return what is remembered from one sample to the next."""
        own = self._own + self.readings.sensor_state(self.n)
        return sum((effect.state(self.n) for effect in self.effects), own)

    @property
    def _own(self) -> Layout:
        n = self.n
        return Layout(
            (
                Field("started", (), "1", "0 before the first sample", kept=False),
                Field("read_q", (n,), "rad", "last reading of q", kept=False, acts=True),
                Field("read_theta", (n,), "rad", "last reading of θ", kept=False, acts=True),
                Field("read_dq", (n,), "rad/s", "low-passed difference of q", kept=False, acts=True),
                Field("read_dtheta", (n,), "rad/s", "low-passed difference of θ", kept=False, acts=True),
                Field("read_tau_a", (n,), "N m", "low-passed τ_a", kept=False, acts=True),
                Field("read_wrench", (6,), "N, N m", "low-passed F_e", kept=False, acts=True),
            )
        )

    def start(self, at: Rest) -> Remembered:
        """Return what they remember at rest."""
        own = self._own.zeros() | {
            "started": at.running,
            "read_q": at.running * at.q,
            "read_theta": at.running * at.theta,
            "read_tau_a": at.running * at.tau_a,
        }
        late = self.readings.sensor_state(self.n)
        still = {"late_q": at.q, "late_theta": at.theta, "late_tau_a": at.tau_a}
        own |= late.zeros()
        own |= {f.name: np.tile(at.running * still[f.name], (f.shape[0], 1)) for f in late if f.name in still}
        return own | {k: v for e in self.effects for k, v in e.start(at).items()}

    def read(self, truth: Measurement, noise: Noise, elapsed: cs.SX, s: Any, g: SensorNumbers) -> Reading:
        """Return the reading of the truth, `elapsed` seconds after the last one."""
        first = s.started < 1
        noisy = (1 + g.torque_scale) * truth.tau_a + g.torque_offset + noise.torque
        tau_a = cs.if_else(first, noisy, low_pass(s.read_tau_a, noisy, g.torque_bandwidth, elapsed))
        F_e = cs.if_else(first, truth.F_e, low_pass(s.read_wrench, truth.F_e, g.wrench_bandwidth, elapsed))
        q, theta = truth.q + g.link_offset, truth.theta + g.motor_offset
        if self.readings.noisy:
            q, theta = q + noise.link, theta + noise.motor
        q, theta = quantised(q, g.link_resolution), quantised(theta, g.motor_resolution)

        def velocity(true: cs.SX, now: cs.SX, last: cs.SX, filtered: cs.SX) -> tuple[cs.SX, cs.SX]:
            rate = cs.if_else(first, 0, difference(last, now, elapsed))
            smooth = low_pass(filtered, rate, g.velocity_bandwidth, elapsed)
            return cs.if_else(g.velocity_differences > 0, smooth, true), smooth

        dq, smooth_dq = velocity(truth.dq, q, s.read_q, s.read_dq)
        dtheta, smooth_dtheta = velocity(truth.dtheta, theta, s.read_theta, s.read_dtheta)
        state = self._own.stack(
            {
                "started": 1,
                "read_q": q,
                "read_theta": theta,
                "read_dq": smooth_dq,
                "read_dtheta": smooth_dtheta,
                "read_tau_a": tau_a,
                "read_wrench": F_e,
            }
        )
        y, kept = self._late(Measurement(q, theta, dq, dtheta, tau_a, F_e, truth.tau_e), first, s, g)
        state = cs.vertcat(state, kept)
        for effect in self.effects:
            y, own = effect.read(y, elapsed, s)
            state = cs.vertcat(state, own)
        return Reading(y, state)

    def _late(self, y: Measurement, first: cs.SX, s: Any, g: SensorNumbers) -> tuple[Measurement, cs.SX]:
        """Return what is handed out of what was read, and what is kept back."""
        rings = self.readings.sensor_state(self.n)
        kept: dict[str, cs.SX] = {}
        periods = {"q": g.link_late, "dq": g.link_late, "theta": g.motor_late, "dtheta": g.motor_late}
        periods |= {"tau_a": g.torque_late, "wrench": g.wrench_late}
        for ring in rings:
            name = ring.name.removeprefix("late_")
            field = "F_e" if name == "wrench" else name
            found = delayed(getattr(s, ring.name), getattr(y, field), periods[name], first)
            y, kept[ring.name] = y._replace(**{field: found.value}), found.past
        return y, rings.stack(kept)
