"""Tool and payload with a mass: as one more link on the flange has it, known to the law or not."""

from __future__ import annotations

from typing import Any

import casadi as cs
import numpy as np
import pytest
from numpy.typing import NDArray

import passiflex as pf
from passiflex.errors import ScenarioError
from passiflex.robots.arm import SerialArm
from passiflex.robots.bodies import Body
from passiflex.robots.carried import carrying
from passiflex.robots.chain import SerialChain
from passiflex.simulation import Problem, resolve
from worlds import world

BODY = {"mass": "1.5 kg", "centre": [0.02, -0.01, 0.06], "inertia": [0.004, 0.005, 0.003, 0.001, 0, -0.0005]}
WAYS: dict[str, dict[str, Any]] = {
    "sampled": {},
    "continuous": {"control": None, "tank": None, "noise": None},
}


def expressions(arm: SerialArm) -> cs.Function:
    p, m = arm.layout.symbols("p")
    q, dq = cs.SX.sym("q", arm.n), cs.SX.sym("dq", arm.n)
    return cs.Function("f", [q, dq, p], [arm.mass_matrix(q, m), arm.bias_torque(q, dq, m)])


@pytest.mark.parametrize("name", ["iiwa14", "planar2r"])
def test_a_body_on_the_flange_is_one_more_link(name: str) -> None:
    """Written into the URDF as a link that is fixed to the tip, and read from there."""
    chain = pf.FlexibleJointRobot.load(name).arm.chain
    xx, yy, zz, xy, xz, yz = BODY["inertia"]  # type: ignore[misc]
    c = " ".join(map(str, BODY["centre"]))  # type: ignore[arg-type]
    more = (
        f'<link name="held"><inertial><origin xyz="{c}"/><mass value="1.5"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/></inertial></link>'
        '<joint name="hold" type="fixed"><parent link="tip"/><child link="held"/></joint></robot>'
    )
    whole = SerialArm(SerialChain.from_urdf(chain.to_urdf().replace("</robot>", more), "held"))
    arm, rng = SerialArm(chain), np.random.default_rng(1)
    body = Body(1.5, np.array(BODY["centre"]), np.array([xx, xy, xz, yy, yz, zz]))
    numbers = arm.nominal() | carrying(chain, arm.nominal(), body)
    q, dq = rng.normal(size=(2, arm.n))
    ours = expressions(arm)(q, dq, arm.layout.pack(numbers))
    theirs = expressions(whole)(q, dq, whole.layout.pack(whole.nominal()))
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(np.array(one), np.array(other), rtol=1e-12, atol=1e-12)


def inertia(problem: Problem, part: str) -> NDArray[np.float64]:
    return np.asarray(problem.parts.unpack(part, problem.numbers)["link_mass"])


@pytest.mark.parametrize("way", WAYS)
def test_the_law_knows_of_the_tool_and_of_a_payload_if_it_is_told(way: str) -> None:
    bare = inertia(resolve(world(**WAYS[way])), "plant")[-1]
    for carried, plant, model in (
        ({"tool": BODY}, 1.5, 1.5),
        ({"payload": BODY}, 1.5, 0.0),
        ({"payload": BODY | {"known": True}}, 1.5, 1.5),
        ({"tool": BODY, "payload": BODY}, 3.0, 1.5),
    ):
        problem = resolve(world(**carried, **WAYS[way]))
        assert inertia(problem, "plant")[-1] == pytest.approx(bare + plant)
        assert inertia(problem, "model")[-1] == pytest.approx(bare + model)


def test_an_unknown_payload_pulls_the_end_effector_down_as_far_as_the_springs_give_way() -> None:
    """The Cartesian one: where the law begins, its springs between motors and links hold the payload already."""
    law = {"gravity": "static", "stiffness": {"translation": "2000 N/m"}}
    scenario = world(law=law, duration=4.0, reference=[], **WAYS["continuous"])
    empty, full = pf.simulate(scenario), pf.simulate(scenario.changed(payload={"mass": "1 kg"}))
    fell = (full["position"] - empty["position"])[-1]
    np.testing.assert_allclose(fell, [0, 0, -9.81 / 2000], rtol=0.03, atol=3e-5)
    known = pf.simulate(scenario.changed(payload={"mass": "1 kg", "known": True}))
    np.testing.assert_allclose(known["position"][-1], empty["position"][-1], atol=2e-5)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"mass": -1}, r"payload\.mass: expected kg, one number, ≥ 0"),
        ({"mass": 1, "inertia": [1, 1, 3]}, r"payload\.inertia: is of no body"),
        ({"inertia": [1, 1, 1]}, r"payload\.mass: is 0, but there is an inertia"),
        ({"mass": 1, "inertia": [1, 1]}, r"payload\.inertia: "),
    ],
)
def test_what_no_body_is_is_said(written: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        world(payload=written)
