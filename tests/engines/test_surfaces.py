"""The surfaces of a scenario in MuJoCo: what presses is the same as in the native loop; what rubs sticks harder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from passiflex.errors import ValueRangeError
from passiflex.exports.model_file import export_model
from passiflex.passivity import audit
from passiflex.problems.problem import SampledProblem
from passiflex.simulation import Run, resolve, simulate_problem
from worlds import world

PLANE: dict[str, Any] = {
    "kind": "plane", "point": [0, 0, -0.01], "normal": [0.1, 0, 1], "relative": True, "stiffness": 1e4,
}  # fmt: skip
KINDS: dict[str, dict[str, Any]] = {
    "hunt_crossley": {"dissipation": 1.0},
    "stiff": {"stiffness": 1e6, "dissipation": 1.0},
    "linear": {"law": "linear", "damping": 20.0},
    "sphere": {"kind": "sphere", "centre": [0, 0, -0.21], "radius": 0.2, "dissipation": 1.0},
    "cylinder": {
        "kind": "cylinder",
        "centre": [0, 0, -0.21],
        "axis": [0, 1, 0],
        "radius": 0.2,
        "length": 0.5,
    },
    "box": {"kind": "box", "centre": [0, 0, -0.11], "size": [0.4, 0.4, 0.2], "dissipation": 1.0},
}


def problem_of(*surfaces: dict[str, Any], **changes: Any) -> SampledProblem:
    down = {
        "reference": [{"at": 0.1, "kind": "step", "by": [0, 0, -0.05]}],
        "duration": 1.0,
        "tank": {"initial": 10},
    }
    environment = [{k: v for k, v in surface.items() if v is not None} for surface in surfaces]
    problem = resolve(world(**down | changes, environment=environment))
    assert isinstance(problem, SampledProblem)
    return problem


def kind_of(name: str) -> dict[str, Any]:
    other = {"point": None, "normal": None} if "kind" in KINDS[name] else {}
    return {**PLANE, **other, **KINDS[name]}


def both(problem: SampledProblem) -> tuple[Run, Run]:
    runs = simulate_problem(problem), simulate_problem(problem, "mujoco")
    assert [run.failure for run in runs] == ["", ""]
    assert [audit(run).verdict for run in runs] == ["passive", "passive"]
    return runs


@pytest.mark.parametrize("name", KINDS)
def test_a_surface_presses_as_in_the_native_loop(name: str) -> None:
    """Force, depth and energies to a share of 1e-3, as MuJoCo's contact has 2e-4 of the hand's mass."""
    surface = kind_of(name)
    native, run = both(problem_of(surface))
    label, peak = surface["kind"], np.abs(native[f"{surface['kind']}_force"]).max()
    assert peak > 10
    assert np.abs(run["q"] - native["q"]).max() < 1e-6
    np.testing.assert_allclose(run[f"{label}_force"], native[f"{label}_force"], rtol=0, atol=2e-3 * peak)
    np.testing.assert_allclose(run[f"{label}_depth"], native[f"{label}_depth"], rtol=0, atol=1e-6)
    np.testing.assert_allclose(run["wrench"][-1], native["wrench"][-1], rtol=1e-3, atol=1e-3)
    for flow in ("", "_given"):
        one, other = (r[f"{label}{flow}_energy"] for r in (native, run))
        np.testing.assert_allclose(
            other, one, rtol=0, atol=1e-3 * np.abs(native[f"{label}_given_energy"]).max()
        )
    seen = audit(run)
    assert seen.integration_error < 1e-4
    assert seen.ledger_residual < 1e-4


def test_what_a_hand_sticks_to_is_rigid_in_mujoco() -> None:
    """So the two differ by how far the bristles bend: less, the stiffer they are."""
    apart = []
    for bristles in (3e3, 3e4, 3e5):
        native, run = both(problem_of({**PLANE, "friction": 0.3, "bristle_stiffness": bristles}))
        apart.append(np.abs(run["q"] - native["q"]).max())
        assert (np.abs(run["plane_force"][:, 0]) < 0.5 * run["plane_force"][:, 2] + 1e-9).all()
        assert audit(run).ledger_residual < 1e-4
    assert apart[0] > 2 * apart[1] > 4 * apart[2]


def test_two_surfaces_share_what_is_given() -> None:
    corner = {"kind": "plane", "name": "side", "point": [-0.01, 0, 0], "normal": [1, 0, 0]}
    problem = problem_of(
        PLANE, {**PLANE, **corner}, reference=[{"at": 0.1, "kind": "step", "by": [-0.05, 0, -0.05]}]
    )
    native, run = both(problem)
    assert np.abs(run["q"] - native["q"]).max() < 1e-6
    assert native["side_force"][-1, 0] > 1
    np.testing.assert_allclose(run["side_force"][-1], native["side_force"][-1], rtol=1e-3, atol=1e-3)
    assert audit(run).ledger_residual < 1e-3


@pytest.mark.parametrize(
    ("changes", "got"),
    [
        ({"motion": [{"at": 0.2, "kind": "step", "by": [0, 0, 0.001]}]}, "one that moves"),
        ({"viscous": 3.0}, "viscous friction"),
    ],
)
def test_a_surface_that_mujoco_does_not_make_is_refused(changes: dict[str, Any], got: str) -> None:
    with pytest.raises(
        ValueRangeError, match=rf"knows no surface as 'plane'; got {got}; needs one at rest.*try the"
    ):
        simulate_problem(problem_of({**PLANE, **changes}), "mujoco")


def test_the_surfaces_of_a_scenario_are_in_its_model_file(tmp_path: Path) -> None:
    """With their stiffness: the hand, let go above a plane, comes to rest on it as deep as its weight asks."""
    out = tmp_path / "model.xml"
    box = {"kind": "box", "centre": [0, 0, -0.31], "size": [0.4, 0.4, 0.2], "point": None, "normal": None}
    problem = problem_of(kind_of("linear"), {**PLANE, **box, "dissipation": 1.0})
    assert export_model(problem, out) == ["the damper of 'box' is left out"]
    model = mujoco.MjModel.from_xml_path(str(out))
    assert model.npair == 2
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = 0
    data.ctrl[model.actuator("fz").id] = -3.0
    steps = round(0.4 / model.opt.timestep)
    deepest = 0.0
    for _ in range(steps):
        mujoco.mj_step(model, data)
        if data.ncon:
            force = np.zeros(6)
            mujoco.mj_contactForce(model, data, 0, force)
            deepest = max(deepest, -data.contact[0].dist)
            assert force[0] < 1.5 * (1e4 * deepest + 20)
    assert deepest > 1e-4
