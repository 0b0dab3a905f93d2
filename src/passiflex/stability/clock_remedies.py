"""What other clock, delay or share of missed periods would make a law hold."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from passiflex.scenarios.sensor_settings import DELAYS
from passiflex.stability.clock_words import hertz
from passiflex.stability.remedy import INSIDE, Remedy, tried
from passiflex.stability.sooner_sensors import SHARES
from passiflex.stability.trial import Trial

FASTER = np.geomspace(1.25, 200, 16)


def fewer_missed(t: Trial) -> Iterator[Remedy]:
    """Yield a smaller share of missed periods."""
    now = t.loop.problem.missed
    share = next((s for s in SHARES if now and t.stable(missed=s * now)), None)
    if share is not None:
        words = f"at most {100 * share * now:.2g} % of the periods missed (now {100 * now:.2g} %)"
        yield Remedy(words, {"control": {"missed": share * now}})


def faster(t: Trial) -> Iterator[Remedy]:
    """Yield a higher rate, with as many periods of delay."""
    factor = next((f for f in map(float, FASTER) if t.stable(stretched=1 / f)), None)
    if factor is None:
        return
    s = t.loop.problem
    rows = 1 / t.problem.output_interval  # of which the new rate is a multiple, so that the rows still fit
    rate = math.ceil(INSIDE * factor / s.period / rows - 1e-9) * rows
    control = {"delay": s.delay / s.period / rate, "jitter": s.jitter / s.period / rate}
    kinds = control | {"delay of the sensors": max(s.lateness)}
    what = " and ".join(name for name, value in kinds.items() if value)
    words = f"a rate of {hertz(rate)}" + f", with as many periods of {what}" * bool(what)
    if s.task_periods > 1:
        control["task_rate"] = rate / s.task_periods
        words += f", and task_rate {hertz(control['task_rate'])}"
    sensors = {name: v / s.period / rate for name, v in zip(DELAYS, s.lateness, strict=True) if v}
    yield Remedy(words, {"control": {"rate": rate, **control}} | ({"sensors": sensors} if sensors else {}))


def faster_task(t: Trial) -> Iterator[Remedy]:
    """Yield a faster clock of the outer loop."""
    s = t.loop.problem
    for periods in range(s.task_periods - 1, 0, -1):
        rate = 1 / (periods * s.period)
        words = f"task_rate of at least {rate:g} Hz (now {1 / (s.task_periods * s.period):g} Hz)"
        remedy = Remedy(words, {"control": {"task_rate": rate}})
        if tried(t.problem, remedy):
            yield remedy
            return


def sooner(t: Trial) -> Iterator[Remedy]:
    """Yield less delay, if the loop was not built for its own."""
    s = t.loop.problem
    if s.controller.inner.predicts:
        return
    now = s.delay + s.jitter
    share = next((v for v in SHARES if now and t.stable(late=v * now)), None)
    if share is not None:
        late = float(f"{share * now:.3g}")
        entry = {"control": {"delay": min(s.delay, late), "jitter": max(late - s.delay, 0.0)}}
        least = f"a delay of at most {1e3 * late:.3g} ms" if late else "no delay"
        yield Remedy(f"{least} (now {1e3 * now:.3g} ms)", entry)


def without_jitter(t: Trial) -> Iterator[Remedy]:
    """Yield commands that all are as late as the law knows."""
    s = t.loop.problem
    if s.jitter and t.stable(late=s.delay):
        yield Remedy(f"no jitter (now {1e3 * s.jitter:.3g} ms)", {"control": {"jitter": 0.0}})
