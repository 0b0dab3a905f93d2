"""What touches a robot, in continuous time as in a sampled run; its books close, and show an element that lies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import casadi as cs
import numpy as np
import pytest

import passiflex as pf
from passiflex.control.motion import Pose
from passiflex.elements import AbstractElement, Effect, Touch, nothing
from passiflex.errors import PassiflexWarning
from passiflex.layout import Field, Layout
from passiflex.passivity import audit, environment_balance
from passiflex.simulation import Run, resolve
from worlds import world

CONTINUOUS: dict[str, Any] = {"control": None, "tank": None, "noise": None}
DRAG = {"environment": [{"kind": "drag", "from": 0.12, "to": 0.4, "viscous": 30.0, "dry": 0.5}]}
RUBBING = {"motors": {"coulomb_friction": [0.3, 0.1], "viscous_friction": 0.5, "friction_width": 0.05}}
PUSH = {"forces": [{"from": 0.05, "to": 0.15, "force": [3, 0, 10]}], "duration": 0.5}
TURRET = str(Path(__file__).parents[1] / "campaigns" / "turret.yaml")
"""Of three joints, which the rigid law needs."""
RIGID: dict[str, Any] = {
    "type": "rigid", "task": "position", "stiffness": {"translation": 60}, "damping": {"translation": 20},
    "target_inertia": {"translation": 3}, "gravity": "robot", "shaped_stiffness": None, "shaped_inertia": None,
}  # fmt: skip
WAYS = {"continuous": CONTINUOUS, "sampled": {"control": {"rate": 16000}}}


@dataclass(frozen=True)
class Bumper(AbstractElement):
    """A mass m of its own on a spring k and a damper d: it stores, loses, and remembers; one-sided in nothing."""

    k: float = 400.0
    d: float = 5.0
    m: float = 0.5
    lies: str = ""
    stores: ClassVar[bool] = True
    meaning: ClassVar[str] = "lost in the bumper"

    def state(self, n: int) -> Layout:
        return Layout(
            (
                Field("bumper_position", (3,), "m", "of its mass", axes=("axis",)),
                Field("bumper_velocity", (3,), "m/s", "of its mass", axes=("axis",)),
            )
        )

    def start(self, at: Pose, n: int) -> dict[str, Any]:
        return self.state(n).zeros() | {"bumper_position": at.position}

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        R, x, v = at.rotation, at.own.bumper_position, at.own.bumper_velocity
        stretch, speed = at.position - x, R @ at.velocity - v
        pull = self.k * stretch + self.d * speed
        lost = self.d * cs.dot(speed, speed)
        stored = self.k * cs.dot(stretch, stretch) / 2 + self.m * cs.dot(v, v) / 2
        if self.lies == "pushes":
            pull = -pull
        if self.lies == "hides":
            lost = lost / 2
        return nothing(at.x.q.numel())._replace(
            force=-R.T @ pull,
            lost=lost,
            stored=stored / 2 if self.lies == "boasts" else stored,
            rate=cs.vertcat(v, pull / self.m),
        )


@dataclass(frozen=True)
class Flywheel(AbstractElement):
    """On the motors: a damper, or a liar."""

    honest: bool = True
    port: ClassVar[Literal["motors", "end effector"]] = "motors"

    def act(self, at: Touch, s: SimpleNamespace, m: SimpleNamespace) -> Effect:
        torque = -0.5 * at.x.dtheta
        lost = -cs.dot(torque, at.x.dtheta)
        return nothing(at.x.q.numel())._replace(motor=torque, lost=lost if self.honest else 2 * lost)


def ran(way: str, elements: tuple[AbstractElement, ...] = (), **changes: Any) -> Run:
    run = pf.simulate(world(**PUSH, **WAYS[way], **changes), elements=elements)
    assert not run.failure
    return run


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("what", [DRAG, RUBBING, DRAG | RUBBING], ids=["drag", "friction", "both"])
def test_the_books_close(way: str, what: dict[str, Any]) -> None:
    run, free = ran(way, **what), ran(way)
    assert np.abs(run["q"] - free["q"]).max() > 1e-3
    assert (
        audit(run).ledger_residual < 3 * audit(free).ledger_residual
    )  # what the integrator leaves without them
    names = [e.name for e in run.elements]
    assert names == ["friction"] * ("motors" in what or way == "sampled") + ["drag"] * ("environment" in what)
    for name in names:
        lost = run[f"{name}_energy"]
        assert (np.diff(lost) >= -1e-12).all()
        assert lost[-1] > (0.01 if name == "drag" or "motors" in what else -1e-12)
    if "drag" in names:
        np.testing.assert_allclose(run["drag_given_energy"], -run["drag_energy"], atol=1e-10)
        assert environment_balance(run).worst < 1e-10


@pytest.mark.parametrize("interval", [0.001, 0.5])
def test_dry_friction_is_resolved_however_few_rows_there_are(interval: float) -> None:
    """It changes its sign within 10 µs where a joint turns; steps for the arm alone missed up to 2 mJ of it."""
    dry = {"coulomb_friction": [1.0, 0.5], "friction_width": 1e-3}
    drag = {"kind": "drag", "from": 0.1, "to": 0.4, "viscous": 20.0, "dry": 5.0}
    run = ran("continuous", motors=dry, environment=[drag], output_interval=interval)
    assert run["friction_energy"][-1] > 0.01
    assert audit(run).ledger_residual < 1e-7


@pytest.mark.parametrize("law", ["impedance", "rigid"])
@pytest.mark.parametrize("what", [DRAG, RUBBING], ids=["drag", "friction"])
def test_a_faster_clock_comes_nearer_to_continuous_time(what: dict[str, Any], law: str) -> None:
    """What a hold of half a period makes is of first order: twice the rate, half the distance. Both laws feel drag."""
    laws: dict[str, Any] = {
        "impedance": {"law": {"shaped_inertia": {"ratio": 1}}},
        "rigid": {"robot": TURRET, "posture": [0.3, 0.5, 0.8], "law": RIGID},
    }
    slow = ran("continuous", **what | laws[law] | _fitting(what, law))
    far = []
    for rate in (4000, 8000, 16000):
        control = {"control": {"rate": rate, "external_torque": "measured"}, "tank": None}
        run = pf.simulate(world(**PUSH, **control, **what | laws[law] | _fitting(what, law)))
        far.append(np.abs(run["q"] - slow["q"]).max())
    assert far[0] / far[1] == pytest.approx(2, rel=0.1)
    assert far[1] / far[2] == pytest.approx(2, rel=0.1)


def _fitting(what: dict[str, Any], law: str) -> dict[str, Any]:
    """Return friction for as many motors as the robot of the law has."""
    if law == "impedance" or "motors" not in what:
        return {}
    return {"motors": what["motors"] | {"coulomb_friction": [0.3, 0.2, 0.1]}}


def test_viscous_drag_alone_is_a_damper_of_the_law() -> None:
    """In all directions and for all time D_x + c, but for the stretch of the joints: ten times stiffer, a tenth."""
    far = []
    for stiffer in (99.0, 999.0):
        stiff = {name: {"joint_stiffness": stiffer} for name in ("deviations", "model_errors")}
        drag = {"environment": [{"kind": "drag", "from": 0, "to": 9, "viscous": 15.0}]}
        ours = ran("continuous", **drag, **stiff)
        theirs = ran("continuous", law={"damping": {"translation": 55.0}}, **stiff)
        far.append(np.abs(ours["position"] - theirs["position"]).max())
    assert far[0] / far[1] == pytest.approx(10, rel=0.15)
    assert np.ptp(ours["position"], axis=0).max() > 100 * far[1]


def test_a_run_without_them_has_nothing_of_them() -> None:
    run = ran("continuous")
    assert run.elements == ()
    assert not {"friction_energy", "drag_energy", "drag_given_energy"} & set(run.data)
    assert [e.name for e in ran("sampled").elements] == ["friction"]


@pytest.mark.parametrize("way", WAYS)
def test_an_element_that_stores_and_remembers_keeps_books(way: str) -> None:
    run = ran(way, (Bumper(),))
    assert audit(run).ledger_residual < 3 * audit(ran(way)).ledger_residual
    assert np.ptp(run["bumper_position"], axis=0).max() > 0.01
    assert run["bumper_storage"].max() > 0.01
    assert run["bumper_energy"][-1] > 1e-3
    rate = np.gradient(run["bumper_position"], run.time, axis=0)
    np.testing.assert_allclose(rate[5:-5], run["bumper_velocity"][5:-5], atol=0.05)
    again = Run(run.data)
    assert again.elements == run.elements
    assert run.elements[-1] == ("bumper", True, True, False)


@pytest.mark.parametrize(
    ("way", "lies"),
    [
        ("continuous", "pushes"),  # which the judge refuses in a sampled run
        *((way, lies) for way in WAYS for lies in ("hides", "boasts")),
    ],
)
def test_an_element_that_lies_is_found_in_the_books_of_a_run(way: str, lies: str) -> None:
    lying = Bumper(40.0, 1.0, lies=lies)
    with pytest.warns(PassiflexWarning, match="Bumper keeps no books"):
        run = pf.simulate(world(**PUSH | {"duration": 0.2}, **WAYS[way]), elements=[lying])
    assert environment_balance(run).worst > 100 * audit(ran(way)).ledger_residual
    assert audit(run).ledger_residual == environment_balance(run).worst


@pytest.mark.parametrize("way", WAYS)
def test_an_element_on_the_motors(way: str) -> None:
    honest = ran(way, (Flywheel(),))
    with pytest.warns(PassiflexWarning, match="Flywheel keeps no books"):
        liar = ran(way, (Flywheel(honest=False),))
    assert audit(honest).ledger_residual < 3 * audit(ran(way)).ledger_residual
    assert honest["flywheel_energy"][-1] > 0.01
    assert audit(liar).ledger_residual > 0.01


def test_the_linear_loop_knows_an_element_with_a_state() -> None:
    """A heavy mass on a stiff spring makes the loop slower than it is without; and what it says, the run does."""
    from passiflex.problems.own_parts import with_parts
    from passiflex.stability.linear_loop import LinearLoop

    problem = resolve(world(law={"gravity": "robot"}))
    bare, touched = LinearLoop(problem), LinearLoop(with_parts(problem, elements=[Bumper()]))
    assert touched.plant.shape == (14, 16)
    assert touched.radius() < 1
    assert touched.radius() != bare.radius()
