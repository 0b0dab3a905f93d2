"""What is said before a run of errors that the tank's books cannot bear, and what is not."""

from __future__ import annotations

import re
from typing import Any

import pytest

from passiflex.simulation import book_cautions as book_cautions_module
from passiflex.simulation import resolve
from passiflex.simulation.book_cautions import book_cautions
from passiflex.simulation.cautions import cautions
from passiflex.stability.noise_credit import POSTURES, noise_credit
from passiflex.studies import shipped_scenario
from worlds import merged, world

LASTING: dict[str, Any] = {
    "law": {"shaped_inertia": {"ratio": 0.1}},
    "control": {"external_torque": "none"},
    "noise": {"torque_variance": 0.2, "hold": 0.02},
    "duration": 60.0,
}


def said(**changes: Any) -> tuple[str, ...]:
    return book_cautions(resolve(world(**changes)))


def test_nothing_is_said_of_good_sensors() -> None:
    assert said() == ()
    assert said(noise={"torque_variance": 0.2, "hold": 0.001}, sensors={"torque_scale": 0.03}) == ()
    assert said(**merged(LASTING, {"duration": 0.5})) == ()
    assert said(**merged(LASTING, {"tank": {"kind": "paper"}})) == ()
    assert cautions(resolve(shipped_scenario("fig2_sampled"))) == ()


def test_noise_that_lasts_is_said_with_its_price_and_an_inertia_that_helps() -> None:
    """The price is that of the run, and what is offered really halves it."""
    (line,) = said(**LASTING)
    power = POSTURES * noise_credit(resolve(world(**LASTING)))
    assert line.startswith("torque noise that lasts 20 ms credits the tank with energy that nobody gave: ")
    assert (
        f"{power:.2g} W are charged for it, {60 * power:.2g} J in 60 s, where 1.9 J are above its floor"
        in line
    )
    found = re.search(r"try shaped_inertia: \{ratio: (\S+)\}, with (\S+) W$", line)
    assert found
    lighter = merged(LASTING, {"law": {"shaped_inertia": {"ratio": float(found[1])}}})
    left = POSTURES * noise_credit(resolve(world(**lighter)))
    assert left == pytest.approx(float(found[2]), rel=0.06)
    assert left <= power / 2


def test_where_no_inertia_helps_another_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(book_cautions_module, "HEAVIER", (0.11,))
    (line,) = said(**LASTING)
    assert line.endswith("; try less noise at low frequencies, or a fuller tank (tank.initial)")


def test_an_offset_above_what_the_floor_holds_back_is_said() -> None:
    """1.6 J in a radian against a floor of 0.1 J; not against one of 2 J, nor for 0.04 N m."""
    (line,) = said(sensors={"torque_offset": [1.0, -0.6]})
    assert line == (
        "an offset of the torque sensors of up to 1 N m gives up to 1.6 J while the joints move by 1 rad, and the "
        "tank, whose floor holds 0.1 J back, sees it too late; try to zero the sensors before the start, or a floor "
        "above that (tank.floor)"
    )
    assert said(sensors={"torque_offset": [1.0, -0.6]}, tank={"floor": 2, "low": 3, "initial": 5}) == ()
    assert said(sensors={"torque_offset": 0.04}) == ()


def test_missed_periods_and_noise_are_said_together() -> None:
    (line,) = said(control={"missed": 0.3}, noise={"torque_variance": 0.2})
    assert line.startswith("30% of the periods are missed while the torque sensors are noisy: ")
    assert said(control={"missed": 0.3}) == ()
