"""Settings of a tank: a kind refuses what it does not go by, and what it says it goes by it does, in its code."""

# ruff: noqa: E501 - one pinned message per line

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as cs
import pytest
import yaml

from passiflex.control.law import ImpedanceLaw
from passiflex.control.signals import Measurement
from passiflex.control.tank import EnergyTank
from passiflex.control.task import PositionTask
from passiflex.errors import ScenarioError
from passiflex.robots.arm import EndEffectorPose
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.sampled.controller import SampledController
from passiflex.sampled.signals import ControlParameters, Setpoint
from passiflex.sampled.tanks import TANKS
from passiflex.scenarios.tank_uses import CONTINUOUS, SAMPLED
from passiflex.simulation import parse_scenario
from worlds import PLAIN, merged, planar_text

UNUSUAL: dict[str, Any] = {
    "fill": 0.5, "floor": 0.03, "low": 0.3, "cap": 9.0, "band": 0.01,
    "accounting": "paper", "power": 3.0, "trip": 0.004, "braking": 7.0,
}  # fmt: skip
"""A value that is no default of any kind, but `accounting`, whose other value is."""
GATED = {"actions": {"follow_velocity": 1}}


def text(kind: str, name: str, **more: Any) -> str:
    value = "signed" if name == "accounting" and kind != "port" else UNUSUAL[name]
    return yaml.safe_dump(merged(yaml.safe_load(PLAIN), more | {"tank": {"kind": kind, name: value}}))


@pytest.mark.parametrize("name", UNUSUAL)
@pytest.mark.parametrize("kind", TANKS)
def test_a_kind_takes_what_it_uses_and_refuses_the_rest(kind: str, name: str) -> None:
    if name in SAMPLED[kind].always:
        tank = parse_scenario(text(kind, name)).tank
        assert tank is not None
        assert getattr(tank, name) != getattr(type(tank)().completed("port"), name) or name == "accounting"
        return
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text(kind, name))
    (mistake,) = error.value.mistakes
    assert f"tank.{name}: a tank of kind {kind} " in mistake


@lru_cache
def named_in_the_code(kind: str) -> set[str]:
    """Return the tank's parameters on which command, memory or ledger of a period depend."""
    controller = SampledController(
        ImpedanceLaw(FlexibleJointRobot.load("planar2r"), PositionTask()), TANKS[kind]()
    )
    n, parts = 2, controller.parameters
    vectors = {part: cs.SX.sym(part, layout.size) for part, layout in parts.layouts.items()}
    views, tank = parts.view(cs.vertcat(*vectors.values())), vectors["tank"]
    pose = EndEffectorPose(cs.SX.sym("p", 3), cs.SX.sym("R", 3, 3))
    sizes = {"q": n, "theta": n, "dq": n, "dtheta": n, "tau_a": n, "tau_e": n, "F_e": 6}
    y = Measurement(**{k: cs.SX.sym(k, size) for k, size in sizes.items()})
    setpoint = Setpoint(
        pose,
        cs.SX.sym("v", 6),
        cs.SX.sym("a", 6),
        cs.SX.sym("K", 3, 3),
        cs.SX.sym("D", 3, 3),
        cs.SX.sym("w", 6),
    )
    state = cs.SX.sym("s", controller.state.size)
    step = controller.step(y, setpoint, cs.SX.sym("dt"), cs.SX.sym("u", n), state, ControlParameters(**views))
    everything = cs.vertcat(step.command.tau_m, step.state, step.entry.valve)
    used = cs.which_depends(everything, tank, 1, False)
    names = [f.name.removeprefix("tank_") for f in controller.tank.layout for _ in range(f.size)]
    return {{"signed": "accounting"}.get(n, n) for n, flag in zip(names, used, strict=True) if flag}


@pytest.mark.parametrize("kind", TANKS)
def test_what_a_kind_says_that_it_uses_is_what_its_code_depends_on(kind: str) -> None:
    """Where the budget is endless, prices are compared with it in vain, in whichever accounting."""
    tank = TANKS[kind]
    level, (_, g) = cs.SX.sym("T"), tank.layout.symbols("g")
    endless = {"accounting"} if not cs.symvar(tank().budget(level, cs.SX.sym("dt"), g)) else set()
    assert named_in_the_code(kind) - endless == {*SAMPLED[kind].all}


def test_what_the_continuous_tank_says_that_it_uses_is_what_its_code_depends_on() -> None:
    tank = EnergyTank()
    vector, g = tank.layout.symbols("g")
    T, P_D, P_X = (cs.SX.sym(name) for name in ("T", "P_D", "P_X"))
    everything = cs.vertcat(*tank.flow(T, P_D, P_X, g), tank.valve(T, g))
    used = cs.which_depends(everything, vector, 1, False)
    names = [f.name.removeprefix("tank_").replace("signed", "accounting") for f in tank.layout]
    assert [n for n, flag in zip(names, used, strict=True) if flag] == [
        n for n in names if n in CONTINUOUS.always
    ]
    assert {*names} == {*CONTINUOUS.always}


def line(text: str) -> str:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text)
    (mistake,) = error.value.mistakes
    return mistake.split(", ", 2)[2]


@pytest.mark.parametrize(
    ("kind", "name", "users"),
    [
        ("port", "fill", "paper, variable_stiffness with `control` and paper without `control`"),
        ("port", "band", "paper without `control`"),
        ("port", "braking", "time_domain with `control`"),
        ("time_domain", "power", "port, paper with `control`"),
        ("variable_stiffness", "trip", "port with `control`"),
    ],
)
def test_who_uses_it_is_said(kind: str, name: str, users: str) -> None:
    assert (
        line(text(kind, name)) == f"tank.{name}: a tank of kind {kind} does not use it; {users} do; remove it"
    )


def test_the_continuous_tank_refuses_what_only_sampled_ones_use() -> None:
    got = line(planar_text(tank={"power": 3}))
    assert (
        got
        == "tank.power: a tank of kind paper without `control` does not use it; port, paper with `control` do; remove it"
    )


@pytest.mark.parametrize("name", ["floor", "low"])
def test_levels_of_a_valve_need_something_to_gate(name: str) -> None:
    """The time-domain tank gates no reference: its valve has the actions and the feed-forward alone."""
    assert line(text("time_domain", name)).startswith(
        f"tank.{name}: a tank of kind time_domain uses it for `actions` and `feedforward` only, and there is neither; "
    )
    parse_scenario(text("time_domain", name, tank={"low": 0.3}, **GATED))


def test_a_cap_below_the_start_is_refused() -> None:
    assert (
        line(planar_text(tank={"initial": 5, "cap": 1}))
        == "tank.cap: needs at least the initial of 5 J: what is above it is spilled; got 1 J"
    )
    assert (
        line(planar_text(tank={"cap": 1}))
        == "tank.cap: needs at least the initial of 2 J (the default): what is above it is spilled; got 1 J"
    )
    assert parse_scenario(planar_text(tank={"initial": 5, "cap": 5})).tank.cap == 5


def test_the_band_belongs_to_the_continuous_tank() -> None:
    narrow = {"initial": 0.24, "cap": 0.24}
    assert (
        line(planar_text(tank=narrow | {"low": 0.2}))
        == "tank.cap: needs more than low + band, 0.25 J; got 0.24 J"
    )
    parse_scenario(yaml.safe_dump(merged(yaml.safe_load(PLAIN), {"tank": narrow})))


def test_old_files_with_every_entry_written_out_load() -> None:
    """A resolved scenario of before has all entries, those that its tank does not use at their defaults."""
    for kind in TANKS:
        data = yaml.safe_load(
            parse_scenario(yaml.safe_dump(merged(yaml.safe_load(PLAIN), {"tank": {"kind": kind}}))).to_yaml()
        )
        assert {"fill", "band", "braking"} <= data["tank"].keys()
        assert parse_scenario(yaml.safe_dump(data)).tank.kind == kind
