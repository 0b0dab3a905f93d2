"""The card of an arm: what it calls safe is stable, also in the nonlinear loop, and what lies beyond is not."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import passiflex as pf
from cli.shell import Shell
from passiflex.cards import Card
from passiflex.cards.border import (
    border,
    damping_window,
    longest_delay,
    searched,
    slowest_clock,
    stiffness_of,
)
from passiflex.cards.setting import SCALES, Setting
from passiflex.cards.sheet import sheet
from passiflex.cards.spread import BRIDGED, ENTRIES, Spread, at_shares, range_of, uncertain
from passiflex.control.posture import posture
from passiflex.control.task import PoseTask, PositionTask
from passiflex.errors import NameUnknownError, PassiflexError
from passiflex.limits.confirmation import disturbed, growth
from passiflex.limits.margin_box import Member
from passiflex.limits.workspace import workspace_postures
from passiflex.plotting.card import draw_page
from passiflex.reports.card_page import card_html, card_text, write_card
from passiflex.robots.flexible import FlexibleJointRobot

RATE, DELAY = 200.0, 0.005
NEAR, ROUND_OFF = 3e-4, 1e-9
"""What grows more slowly than by the first is not seen to grow in two thousand periods."""


@lru_cache
def setting() -> Setting:
    arm = FlexibleJointRobot.load("so101")
    return Setting(arm, RATE, DELAY, workspace_postures(arm, PositionTask(), 2), "position")


@lru_cache
def found() -> Card:
    """Return a card of few tools and stiffnesses, of an arm without torque sensors."""
    with pytest.MonkeyPatch.context() as patch:
        module = sys.modules[Card.__module__]  # whose name is that of its function
        patch.setattr(module, "TOOLS", (1.0,))
        patch.setattr(module, "STIFFNESSES", (20.0, 200.0))
        patch.setattr(module, "SLOW", (200.0, 500.0))
        return pf.card("so101", RATE, DELAY)


def random_member(s: Setting, rng: np.random.Generator) -> Member:
    off = rng.choice([-1.0, 1.0], 5 * s.robot.n + 1)
    off[4 * s.robot.n + 1 :] = 0
    return Member(int(rng.integers(len(s.postures))), tuple(off.tolist()))


def grows(s: Setting, member: Member, gains: dict[str, np.ndarray]) -> bool:
    return growth(disturbed(s.simulated(member, gains))) >= 1


def test_what_is_safe_is_stable_on_random_corners_and_what_is_beyond_is_not() -> None:
    s, rng = setting(), np.random.default_rng(3)
    b = border(s, "translation")
    assert 10 < b.stiffness < 10_000
    half = stiffness_of("translation", b.stiffness / 2)
    design = s.gains(*half)["damping"][0, 0]
    for _ in range(25):
        share = math.exp(rng.uniform(math.log(b.damping.least), math.log(b.damping.most))) / design
        assert s.radius(random_member(s, rng), s.gains(*half, (share, 1.0))) < 1
    for scale in np.geomspace(0.35, 16, 13):  # whatever damping: some robot of the box does not hold
        far = s.gains(*stiffness_of("translation", 5 * b.stiffness), (scale, 1.0))
        assert max(s.radius(m, far) for m in s.members) >= 1
    assert b.mode is not None
    assert b.joint in b.why


def test_theory_and_the_nonlinear_loop_say_the_same_on_both_sides() -> None:
    s, rng, told = setting(), np.random.default_rng(5), []
    b = border(s, "translation")
    while len(told) < 10:
        k, damping = b.stiffness * 10 ** rng.uniform(-0.5, 1.5), b.damping.most * rng.uniform(0.2, 3)
        pair = stiffness_of("translation", k)
        share = damping / s.gains(*pair)["damping"][0, 0]
        gains, member = s.gains(*pair, (share, 1.0)), random_member(s, rng)
        radius = s.radius(member, gains)
        if not 1 - ROUND_OFF < radius < 1 + NEAR:
            told.append((radius >= 1, grows(s, member, gains)))
    assert {stable for stable, _ in told} == {True, False}
    assert all(theory == simulated for theory, simulated in told)


def test_the_slowest_clock_and_the_longest_delay_are_borders() -> None:
    s, k = setting(), 30.0
    known, rate, delay = slowest_clock(s, k, search=False), slowest_clock(s, k), longest_delay(s, k)
    assert known <= rate < RATE
    assert delay > DELAY
    gains = [s.gains(*stiffness_of("translation", k), scales) for scales in SCALES]
    assert any(s.holds(g, 1 / known, 1 / known) for g in gains)
    assert not any(s.holds(g, 1 / (0.9 * known), 1 / (0.9 * known)) for g in gains)
    for faster in np.geomspace(1.01 * rate, 5000, 12):  # what holds at the border holds on this side of it
        assert any(s.holds(g, 1 / faster, 1 / faster) for g in gains)
    for less in np.linspace(0, delay, 8):
        assert any(s.holds(g, 1 / RATE, less) for g in gains)
    assert searched(s.at(rate, 1 / rate), "translation", k) is not None
    assert searched(s.at(RATE, delay), "translation", k) is not None
    assert math.isnan(longest_delay(s, 1e6))
    assert math.isnan(damping_window(s, "translation", 1e6).least)


def test_nothing_stiffer_than_the_springs_of_the_joints_is_looked_for() -> None:
    """Of a robot with springs so soft that all K_x up to them hold: 1/λ of J K⁻¹ Jᵀ, by hand."""
    s = setting()
    soft = dataclasses.replace(s.robot, joint_stiffness=s.robot.joint_stiffness / 200)
    other = dataclasses.replace(s, robot=soft, _members=[], rate=2000.0, delay=0.0)
    ways = [posture(soft, q, soft.nominal()).jacobian[:3] for q in other.postures]
    gives = [np.linalg.eigvalsh(J @ np.diag(1 / soft.joint_stiffness) @ J.T)[-1] for J in ways]
    springs = np.exp(-np.mean(np.log(gives)))
    assert other.springs["translation"] == pytest.approx(springs, rel=1e-9)
    b = border(other, "translation", thorough=False)
    assert b.stiffness == pytest.approx(springs, rel=1e-9)
    assert b.why == "the springs of the joints"


def test_what_moves_is_that_of_the_ways_the_end_effector_can_go() -> None:
    """The arm of two joints cannot go across its plane."""
    arm = FlexibleJointRobot.load("planar2r")
    s = Setting(arm, 1000.0, 1e-3, np.array([[0.3, 1.2]]), "position")
    at = posture(arm, np.array([0.3, 1.2]), arm.nominal())
    J = at.jacobian[[0, 2]]
    mobility = J @ np.linalg.solve(at.mass_matrix + np.diag(arm.motor_inertia), J.T)
    assert s.felt[0] == pytest.approx(1 / np.sqrt(np.linalg.det(mobility)), rel=1e-9)


def test_a_robot_beside_its_posture_is_simulated_where_it_is() -> None:
    s, rng, told = setting(), np.random.default_rng(8), []
    while len(told) < 6:
        off = rng.choice([-1.0, 1.0], 5 * s.robot.n + 1)
        member = Member(int(rng.integers(len(s.postures))), tuple(off.tolist()))
        gains = s.gains(10 ** rng.uniform(1.5, 3.5), 30.0, SCALES[int(rng.integers(len(SCALES)))])
        problem, radius = s.simulated(member, gains), s.radius(member, gains)
        np.testing.assert_array_equal(problem.q, s.box.angles(member))
        assert np.abs(problem.q - s.postures[member.posture]).max() > 0.1
        assert problem.delay == s.box.late(member)
        if not 1 - ROUND_OFF < radius < 1 + NEAR:
            told.append((radius >= 1, growth(disturbed(problem)) >= 1))
    assert {stable for stable, _ in told} == {True, False}
    assert all(theory == simulated for theory, simulated in told)


def test_what_no_search_has_passed_is_not_called_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    assert border(setting(), "translation", thorough=False).stiffness > 10
    monkeypatch.setattr(Setting, "searched", lambda self, gains, **_: False)
    assert border(setting(), "translation").stiffness == 0
    assert math.isnan(damping_window(setting(), "translation", 10.0).least)


def test_holds_is_a_radius_below_one() -> None:
    """Also of an arm whose self-motion drifts, at gains that hold and at others."""
    arm = FlexibleJointRobot.load("iiwa14")
    s = Setting(arm, 1000.0, 1e-3, workspace_postures(arm, PoseTask(), 2))
    rng, said = np.random.default_rng(1), []
    for _ in range(40):
        gains = s.gains(
            10 ** rng.uniform(2, 4.5), 10 ** rng.uniform(1, 3.3), SCALES[rng.integers(len(SCALES))]
        )
        period = 10 ** rng.uniform(-4, -2)
        loop, _ = s.box.loop(s.members[int(rng.integers(len(s.members)))])
        said.append(loop.holds(period, period, gains))
        assert said[-1] == (loop.radius(period, period, gains) < 1)
    assert {*said} == {True, False}


def test_what_is_assumed_is_looked_at_over_its_range() -> None:
    """The same gains for stiffnesses in steps that the margin bridges, with the least damping; and at all corners."""
    s = setting()
    spread, K = Spread.over(s), s.robot.joint_stiffness
    assert uncertain(s.robot) == ENTRIES
    ranges = {entry: range_of(s.robot, entry) for entry in ENTRIES}
    found = {
        tuple(round(float((getattr(one.robot, e) / getattr(s.robot, e))[0]), 6) for e in ENTRIES)
        for one in spread.settings[1:]
    }
    for corner in itertools.product(*ranges.values()):
        assert any(np.allclose(corner, one, rtol=1e-4) for one in found)
    soft = sorted(one[0] for one in found if one[1:] == tuple(round(ranges[e][0], 6) for e in ENTRIES[1:]))
    assert max(b / a for a, b in itertools.pairwise(soft)) <= BRIDGED * (1 + 1e-6)
    assert soft[0] * K[0] == pytest.approx(ranges["joint_stiffness"][0] * K[0])
    known = dataclasses.replace(s.robot, sources={}, ranges={})
    assert len(Spread.over(dataclasses.replace(s, robot=known)).settings) == 1


def test_gains_over_what_is_assumed_hold_on_robots_drawn_from_it() -> None:
    narrow = {"joint_stiffness": (0.6, 1.6), "joint_damping": (0.5, 2.0), "motor_inertia": (0.7, 1.5)}
    robot = dataclasses.replace(setting().robot, ranges=narrow)
    s = dataclasses.replace(setting(), robot=robot, rate=500.0, delay=2e-3, _members=[])
    bare, rng = border(s, "translation", thorough=False), np.random.default_rng(11)
    over = border(Spread.over(s), "translation", thorough=False, most=bare.stiffness)
    assert 10 < over.stiffness < bare.stiffness
    for _ in range(12):
        other = at_shares(s, {e: math.exp(rng.uniform(*np.log(range_of(s.robot, e)))) for e in ENTRIES})
        gains = other.gains(*stiffness_of("translation", over.stiffness / 2))
        gains["damping"] = np.eye(3) * math.exp(rng.uniform(*np.log(over.damping[:2])))
        for _ in range(6):
            assert other.radius(random_member(other, rng), gains) < 1


def test_a_card_says_it_all_on_one_page() -> None:
    card = found()
    titles = [block.title for block in sheet(card)]
    assert titles[:4] == ["Answer", "Largest safe K_x", "At other rates", "Lowest rate and longest delay"]
    text = card_text(card)
    flat = " ".join(text.split())
    for said in (
        "so101 at 200 Hz with 1 period of delay",
        "K_x up to ",
        "None: the arm measures no joint torque.",
        "With its joints as they are in its file, set K_x to ",
        "Assumed, or not well known: joint_stiffness 0.2 to 5 times, joint_damping",
        "there is no K_x of 10 N/m or more with 24% of critical damping or more",
        "2 √K_x",
        "passiflex card so101 --rate '200 Hz' --delay '5 ms'",
    ):
        assert said in flat, said
    assert max(map(len, text.splitlines())) <= 140
    assert text.count("\n") < 70
    assert card.shaping is None
    assert [(row.tool, row.over) for row in card.rows] == [(0.0, False), (0.0, True), (1.0, False)]
    assert [at.rate for at in card.slow] == [200.0, 500.0]
    assert card.slow[0].border is card.bare.border
    assert card.slow[0].border.stiffness < card.slow[1].border.stiffness
    assert card.clocks[0].rate < card.clocks[1].rate
    assert {hang.entry for hang in card.hangs} == {"joint_stiffness", "joint_damping", "motor_inertia"}
    assert any(told.growth >= 1 for told in card.folklore)  # 5000 N/m on an arm of servos


def test_a_page_needs_nothing_beside_it(tmp_path: Path) -> None:
    page = card_html(found())
    assert "<svg" in page
    assert not re.findall(r'(?:src|href)="(?!#)[^"]+"', page.replace("xlink:href", "x"))
    for form, begins in ((".html", b"<!doctype html>"), (".pdf", b"%PDF"), (".txt", b"passiflex card:")):
        assert write_card(found(), tmp_path / f"c{form}").read_bytes().startswith(begins)
    with pytest.raises(NameUnknownError, match=r"ending of a card; got '\.doc'"):
        write_card(found(), tmp_path / "c.doc")


def test_the_page_of_paper_holds_all_of_its_text_and_the_picture_beside_it() -> None:
    """Of the longest lines that there are, too."""
    text = card_text(found())
    for page in (text, text + "x" * 160 + "\n" + 30 * "a line\n"):
        figure = draw_page(found(), page)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        words, picture = figure.texts[0].get_window_extent(), figure.axes[0].get_tightbbox()
        width, height = figure.get_size_inches() * figure.dpi
        assert words.x0 >= 0
        assert words.x1 <= width
        assert words.y0 >= picture.y1
        assert picture.y0 >= 0
        assert picture.x1 <= width
        assert words.y1 <= height


def test_the_command_prints_the_card_and_writes_its_forms(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    asked = []

    def noted(*arguments: object, **more: object) -> Card:
        asked.append((arguments, more["sensed"]))
        return found()

    monkeypatch.setattr("passiflex.cards.card", noted)
    shell = Shell(monkeypatch, capsys)
    result = shell("card", "so101", "--rate", "200 Hz", "--out", tmp_path / "cards")
    assert result.status == 0, result.err
    assert shell("card", "so101", "--rate", "200 Hz", "--delay", "5 ms", "--no-sensed").status == 0
    assert asked == [(("so101", "200 Hz", None), None), (("so101", "200 Hz", "5 ms"), False)]
    assert card_text(found()).splitlines()[4] in result.out
    assert sorted(p.name for p in (tmp_path / "cards").iterdir()) == ["so101.html", "so101.pdf", "so101.txt"]


def test_what_makes_no_sense_is_said() -> None:
    for arguments, message in (
        (("so10", 100), "unknown robot; got 'so10'.*try 'so101'"),
        (("so101", 0), "rate"),
        (("so101", "100 m"), "rate"),
        (("so101", 100, -1), "delay"),
        (("so101", 100, 5), "delay; got 5 s; needs at most 18 periods, 0.18 s"),
    ):
        with pytest.raises(PassiflexError, match=message):
            sys.modules[Card.__module__].card(*arguments)
