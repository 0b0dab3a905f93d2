"""Friction that is made up for behind the tank's valve: what it gives, what too much of it does, and who says so."""

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np
import pytest

from passiflex.errors import SizeError, UnstableLoopError
from passiflex.passivity import audit
from passiflex.reports.facts import facts
from passiflex.sampled.actions import action_layout, friction_compensation
from passiflex.simulation import Run, parse_scenario, resolve, simulate
from passiflex.simulation.cautions import cautions
from worlds import books, ran, world

FRICTION: dict[str, Any] = {"coulomb_friction": 3, "viscous_friction": 5, "friction_width": 0.05}
EQUAL: dict[str, Any] = {"coulomb_compensation": 3, "viscous_compensation": 5, "compensation_width": 0.05}


def sticking(compensated: float, width: float = 0.02, **changes: Any) -> Run:
    """Return a run with 2 N m of friction that sticks, and this much made up for."""
    motors = {"coulomb_friction": 2, "friction": "sticks"}
    actions = {"coulomb_compensation": compensated, "compensation_width": width}
    return ran(**{"duration": 2.0, "motors": motors, "actions": actions} | changes)


def off(run: Run) -> float:
    return float(np.linalg.norm((run["position"] - run["desired_position"])[-1]))


def test_what_it_gives_is_less_than_friction_of_that_size_takes() -> None:
    numbers = action_layout(2).symbols("a")[1]
    dtheta = cs.SX.sym("dtheta", 2)
    given = friction_compensation(dtheta, numbers)
    names = ("coulomb_compensation", "viscous_compensation", "compensation_width")
    f = cs.Function("f", [dtheta, *(getattr(numbers, n) for n in names)], [given])
    for speed in np.geomspace(1e-4, 10, 30):
        torque = np.asarray(f([speed, -speed], [3, 1], [5, 0], 0.05)).ravel()
        assert 0 < torque[0] - 5 * speed < 3 * np.tanh(speed / 0.05)
        assert -np.tanh(speed / 0.05) < torque[1] < 0
    fast = np.asarray(f([5, -5], [3, 1], [5, 0], 0.05)).ravel()
    np.testing.assert_allclose(fast, [28, -1], rtol=1e-3)
    slope = cs.Function("s", f.sx_in(), [cs.jacobian(f(*f.sx_in()), f.sx_in()[0])])
    np.testing.assert_allclose(np.asarray(slope([0, 0], [3, 1], [5, 0], 0.05)), np.diag([5, 0]), atol=1e-12)


@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_a_motor_moves_as_if_it_had_no_viscous_friction(inner: str) -> None:
    """Up to the hold: it is half a period late, so that the difference halves with the period."""
    apart = []
    for rate in (1000, 2000):
        how: dict[str, Any] = {
            "control": {"rate": rate, "inner_loop": inner, "external_torque": "none"},
            "law": {"shaped_inertia": {"ratio": 0.5}},
            "output_interval": 0.005,
        }
        rubbing = {"viscous_friction": 5}
        free, rough = ran(**how), ran(**how, motors=rubbing)
        run = ran(**how, motors=rubbing, actions={"viscous_compensation": 5})
        apart.append(np.abs(run["q"] - free["q"]).max())
        assert apart[-1] < 0.02 * np.abs(rough["q"] - free["q"]).max()
        assert np.ptp(books(run)) < 1e-12
    assert apart[1] == pytest.approx(apart[0] / 2, rel=0.15)


def test_with_dry_friction_too_it_lags_by_little() -> None:
    free, rough, run = ran(), ran(motors=FRICTION), ran(motors=FRICTION, actions=EQUAL)
    assert np.abs(run["q"] - free["q"]).max() < 0.25 * np.abs(rough["q"] - free["q"]).max()
    given = np.sum(run["compensation_power"][:-1]) * 1e-3
    assert 0.8 * run["friction_energy"][-1] < given < run["friction_energy"][-1]


def test_on_friction_that_sticks_it_comes_to_rest_with_a_fraction_of_the_error() -> None:
    """And does not tremble: made up for too steeply, the motor that gives way within its friction would."""
    errors = []
    for compensated in (0, 1.6):
        run = sticking(compensated, width=0.05, duration=4.0)
        assert np.abs(run["dq"][-500:]).max() < 1e-6
        errors.append(off(run))
    assert errors[0] > 0.01
    assert errors[1] < errors[0] / 4


@pytest.mark.parametrize("damping", [5, 40])
@pytest.mark.parametrize("compensated", [4, 8])
def test_too_much_of_it_never_rests_and_a_tank_throttles_it(compensated: float, damping: float) -> None:
    """More power than friction takes comes from it; with little in the tank the valve closes on the difference."""
    law = {"damping": {"translation": damping}}
    rich = sticking(compensated, law=law, tank={"initial": 50.0, "cap": 60.0})
    assert np.abs(rich["dq"][-200:]).max() > 1
    assert rich["compensation_power"].mean() > 1.5 * rich["friction_energy"][-1] / 2.0
    poor = sticking(compensated, law=law, tank={"initial": 0.3})
    assert poor["valve"].min() < 1e-6
    assert poor["compensation_power"][-500:].mean() < 0.5 * rich["compensation_power"][-500:].mean()
    for run in (rich, poor):
        assert audit(run).verdict == "passive"
        assert not run["latched"][-1]


def test_more_than_the_motors_have_is_said_before_a_run() -> None:
    """By height, or because it comes at lower speeds than theirs."""

    def told(motors: dict[str, Any], actions: dict[str, Any]) -> tuple[str, ...]:
        return cautions(resolve(world(motors=motors, actions=actions)))

    (line,) = told({"coulomb_friction": [2, 4]}, {"coulomb_compensation": 3})
    assert line.startswith("actions make up for more dry friction than joint 1 has, by 1 N m at")
    assert told({"coulomb_friction": [2, 4]}, {"coulomb_compensation": [2, 4]}) == ()
    (line,) = told(FRICTION, EQUAL | {"compensation_width": 0.01})
    assert line.startswith("actions make up for more dry friction than joint 1 has")
    (line,) = told({"coulomb_friction": 3, "friction": "sticks"}, {"coulomb_compensation": 2.5})
    assert line.startswith("friction of joint 1 sticks, and making up for it takes away up to 32 N m s/rad")


def test_viscous_friction_that_is_not_there_is_refused_with_a_share_that_holds() -> None:
    motors = {"viscous_friction": 1}
    with pytest.raises(
        UnstableLoopError, match="viscous friction is made up for that the motors do not have"
    ) as e:
        ran(motors=motors, actions={"viscous_compensation": 20})
    offered = float(str(e.value).split("viscous_compensation times ")[1].split()[0].rstrip(";"))
    assert audit(ran(motors=motors, actions={"viscous_compensation": 20 * offered})).verdict == "passive"


def test_a_run_that_compensates_nothing_has_no_signal_of_it() -> None:
    assert "compensation_power" not in simulate(world()).data


def test_a_list_of_other_length_is_refused() -> None:
    with pytest.raises(SizeError, match=r"actions\.coulomb_compensation"):
        resolve(world(actions={"coulomb_compensation": [1, 2, 3]}))


def test_it_is_read_back_from_its_own_text() -> None:
    scenario = world(actions=EQUAL)
    assert parse_scenario(scenario.to_yaml()) == scenario


def test_a_report_says_what_sticks_and_what_is_made_up_for() -> None:
    run = sticking(1.6, width=0.05)
    told = dict(facts(run, run.scenario))
    assert told["motors"].endswith("with friction that sticks")
    assert told["friction made up for"] == "up to 1.6 N m and 0 N m s/rad, as the valve is open"
