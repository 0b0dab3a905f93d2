"""The judge: drift is no instability, every end counts, causes are named, and each remedy that is offered helps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ladders import ladder
from passiflex.errors import UnstableLoopError
from passiflex.problems.altered import rewritten, with_flange
from passiflex.simulation import Problem, parse_scenario, resolve
from passiflex.simulation.stability_cautions import stability_cautions
from passiflex.stability.admissible import check, require_stable
from passiflex.stability.causes import advise
from passiflex.stability.judgement import holds, judge, judged_fallback
from passiflex.stability.linear_loop import LinearLoop
from worlds import world


def redundant(**law: Any) -> Problem:
    """Return an arm that turns about y at three joints, with a position task: one of them is free."""
    own = {"regularisation": 1e-6, "null_space_damping": 0.0} | law
    return resolve(world(posture=[0.4, 0.7, 0.5], law=own, reference=[]), ladder("yyy"))


def test_a_self_motion_that_nothing_damps_makes_no_loop_unstable() -> None:
    found = check(redundant())
    assert found.stable
    assert found.spectrum.drifting == 2
    assert 0 < found.least_inertia < 0.5
    assert found.sentence.endswith("nothing holds or damps the self-motion: once pushed, it drifts on")
    (line,) = stability_cautions(redundant())
    assert "null_space_damping or actions.posture_stiffness ends it" in line


def test_a_damped_self_motion_still_drifts_once_and_a_planar_arm_with_two_joints_has_none() -> None:
    damped = check(redundant(null_space_damping=5.0))
    assert damped.spectrum.drifting == 1
    assert damped.sentence.endswith("nothing holds the self-motion: it stays where a push leaves it")
    assert stability_cautions(redundant(null_space_damping=5.0)) == ()
    assert judge(resolve(world())).spectrum.drifting == 0


CASES: dict[str, tuple[dict[str, Any], str]] = {
    "light motor": (
        {"control": {"delay": 1e-3}, "law": {"shaped_inertia": {"ratio": 0.05}}},
        "B_e = 0.05 B makes motor",
    ),
    "stiff joint": (
        {"control": {"delay": 1e-3}, "law": {"shaped_stiffness": {"ratio": 18}}},
        "K_e = 18 K needs the links' inertia",
    ),
    "much damping": (
        {
            "control": {"rate": 125, "delay": 8e-3},
            "law": {"shaped_inertia": {"ratio": 1}, "damping": {"translation": 400}},
            "output_interval": 8e-3,
        },
        "too much damping",
    ),
    "jitter": (
        {"control": {"jitter": 1e-3}, "law": {"shaped_inertia": {"ratio": 0.06}}},
        "commands that the jitter makes later",
    ),
    "fallback": (
        {
            "control": {
                "delay": 1e-3,
                "fallback": {"shaped_stiffness": {"ratio": 1}, "shaped_inertia": {"ratio": 0.01}},
            }
        },
        "once fallen back, ",
    ),
    "change of gains": (
        {"gains": [{"at": 0.1, "duration": 0.1, "damping": {"translation": 4000}}]},
        "with the gains that it goes over to, ",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_the_cause_is_named_and_each_remedy_helps(name: str) -> None:
    """The remedies are written into the scenario and judged anew; none is what stands there already."""
    changes, cause = CASES[name]
    problem = resolve(world(**changes))
    found = judge(problem)
    assert not found.stable
    advice = advise(problem, found)
    assert cause in advice.cause
    assert len(str(advice).splitlines()) == 3
    for remedy in advice.remedies:
        if remedy.entry:
            text = rewritten(problem.text, remedy.entry)
            assert text != rewritten(problem.text, {})
            assert holds(resolve(parse_scenario(text)))
    assert advice.remedies
    assert (
        not any("D_x" in r.words for r in advice.remedies) or name != "change of gains"
    )  # that is its author's


def test_the_remedies_for_too_much_damping_begin_with_less_of_it() -> None:
    problem = resolve(world(**CASES["much damping"][0]))
    words = [r.words for r in advise(problem, judge(problem)).remedies]
    assert words[0].startswith("D_x times 0.")


def test_joint_by_joint_only_the_one_that_trembles_is_made_heavier() -> None:
    problem = resolve(world(control={"delay": 1e-3}, law={"shaped_inertia": {"ratio": [0.05, 0.5]}}))
    first = advise(problem, judge(problem)).remedies[0]
    ratio = first.entry["law"]["shaped_inertia"]["ratio"]
    assert "B_e of joint 1" in first.words
    assert ratio[1] == pytest.approx(0.5, rel=0.01)
    assert ratio[0] > 0.08


def test_who_insists_is_told_of_a_fallback_that_holds() -> None:
    """The law itself does not, and need not."""
    light = {"shaped_stiffness": {"ratio": 1}, "shaped_inertia": {"ratio": 0.02}}
    control = {"delay": 1e-3, "allow_unstable": True, "fallback": light}
    problem = resolve(world(control=control, law={"shaped_inertia": {"ratio": 0.05}}))
    with pytest.raises(
        UnstableLoopError, match=r"the fallback of .*\n.*\n.*\n  remedy: B_e of .* at least 0\.0\d+ B"
    ):
        require_stable(problem)
    (line,) = stability_cautions(problem)
    assert line.startswith("the law is allowed though it does not hold: joint 1, ")


def test_a_rate_that_is_offered_fits_the_rows_of_the_file() -> None:
    problem = resolve(world(control={"delay": 1e-3}, law={"shaped_inertia": {"ratio": 0.05}}))
    (remedy,) = (r for r in advise(problem, judge(problem)).remedies if "a rate of" in r.words)
    assert remedy.words == "a rate of 3 kHz, with as many periods of delay"
    assert set(remedy.entry) == {"control"}


def test_holds_and_judge_say_the_same() -> None:
    for changes, _ in CASES.values():
        problem = resolve(world(**changes))
        assert not holds(problem)
        assert not holds(problem, native=False)
    assert holds(resolve(world()))
    assert judge(resolve(world())).stable


def test_the_fallback_is_judged_by_itself() -> None:
    problem = resolve(world(**CASES["fallback"][0]))
    alone = judged_fallback(problem)
    assert alone is not None
    assert alone.part == "fallback"
    assert not alone.stable
    assert judged_fallback(resolve(world(tank={"kind": "paper"}))) is None


def test_a_heavier_flange_is_the_last_links_inertia_in_robot_and_model() -> None:
    problem = resolve(world())
    heavier = with_flange(problem, 0.02)
    layout = problem.law.robot.layout
    for flat, other in ((problem.plant, heavier.plant), (problem.model, heavier.model)):
        before, after = layout.unpack(flat)["link_inertia"], layout.unpack(other)["link_inertia"]
        np.testing.assert_allclose(after[-1] - before[-1], [0.02, 0, 0, 0.02, 0, 0.02], atol=1e-15)
        np.testing.assert_array_equal(after[:-1], before[:-1])
    masses = [
        np.linalg.inv(loop.plant[4:6, 2:4] / layout.unpack(problem.plant)["joint_stiffness"])
        for loop in (LinearLoop(problem), LinearLoop(heavier))
    ]
    np.testing.assert_allclose(
        masses[1] - masses[0], 0.02 * np.ones((2, 2)), rtol=1e-5
    )  # both turn it about y
