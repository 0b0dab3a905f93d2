"""The card of an arm: what it calls safe is stable, also in the nonlinear loop, and what lies beyond is not."""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import passiflex as pf
from cli.shell import Shell
from passiflex.cards import Card
from passiflex.cards.border import SCALES, border, damping_window, longest_delay, slowest_clock, stiffness_of
from passiflex.cards.setting import Setting
from passiflex.cards.sheet import sheet
from passiflex.control.task import PositionTask
from passiflex.errors import NameUnknownError, PassiflexError
from passiflex.limits.confirmation import disturbed, growth
from passiflex.limits.margin_box import Member
from passiflex.limits.workspace import workspace_postures
from passiflex.problems.altered import altered
from passiflex.reports.card_page import card_html, card_text, write_card
from passiflex.robots.flexible import FlexibleJointRobot

RATE, DELAY = 100.0, 0.01
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
        return pf.card("so101", RATE, DELAY)


def random_member(s: Setting, rng: np.random.Generator) -> Member:
    off = rng.choice([-1.0, 1.0], 5 * s.robot.n + 1)
    off[4 * s.robot.n + 1 :] = 0
    return Member(int(rng.integers(len(s.postures))), tuple(off.tolist()))


def grows(s: Setting, member: Member, gains: dict[str, np.ndarray]) -> bool:
    changed = altered(s.box.problems[member.posture], gains=gains, plant=s.box.plant(member))
    return growth(dataclasses.replace(disturbed(changed), delay=s.box.late(member))) >= 1


def test_what_is_safe_is_stable_on_random_corners_and_what_is_beyond_is_not() -> None:
    s, rng = setting(), np.random.default_rng(3)
    b = border(s, "translation")
    assert 10 < b.stiffness < 10_000
    half = stiffness_of("translation", b.stiffness / 2)
    design = s.gains(*half)["damping"][0, 0]
    for _ in range(25):
        share = math.exp(rng.uniform(math.log(b.damping.least), math.log(b.damping.most))) / design
        assert s.radius(random_member(s, rng), s.gains(*half, (share, 1.0))) < 1
    for scale in np.geomspace(1 / 16, 16, 13):  # whatever damping: some robot of the box does not hold
        far = s.gains(*stiffness_of("translation", 1.5 * b.stiffness), (scale, 1.0))
        assert max(s.radius(m, far) for m in s.members) >= 1
    assert b.mode is not None
    assert b.joint in b.why


def test_theory_and_the_nonlinear_loop_say_the_same_on_both_sides() -> None:
    s, rng, told = setting(), np.random.default_rng(5), []
    b = border(s, "translation")
    while len(told) < 10:
        k, damping = b.stiffness * rng.uniform(0.3, 1.5), b.damping.most * rng.uniform(0.2, 2)
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
    rate, delay = slowest_clock(s, k), longest_delay(s, k)
    assert rate < RATE
    assert delay > DELAY
    gains = [s.gains(k, 30.0, scales) for scales in SCALES]
    assert any(s.holds(g, 1 / rate, 1 / rate) for g in gains)
    assert not any(s.holds(g, 1 / (0.9 * rate), 1 / (0.9 * rate)) for g in gains)
    assert not any(s.holds(g, 1 / RATE, delay + 0.1 / RATE) for g in gains)
    for faster in np.geomspace(1.01 * rate, 5000, 12):  # what holds at the border holds on this side of it
        assert any(s.holds(g, 1 / faster, 1 / faster) for g in gains)
    for less in np.linspace(0, delay, 8):
        assert any(s.holds(g, 1 / RATE, less) for g in gains)
    assert math.isnan(longest_delay(s, 1e6))
    assert math.isnan(damping_window(s, "translation", 1e6).least)


def test_what_no_search_has_passed_is_not_called_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Setting, "searched", lambda self, gains: False)
    assert border(setting(), "translation").stiffness == 0
    assert border(setting(), "translation", searched=False).stiffness > 10


def test_a_card_says_it_all_on_one_page() -> None:
    card = found()
    titles = [block.title for block in sheet(card)]
    assert titles[:3] == ["Answer", "Largest safe K_x", "Lowest rate and longest delay"]
    text = card_text(card)
    for said in (
        "so101 at 100 Hz with 1 period of delay",
        "K_x up to ",
        "None: the arm measures no joint torque.",
        "Assumed, not measured: joint_stiffness, joint_damping, motor_inertia",
        "2 √K_x",
        "passiflex card so101 --rate '100 Hz' --delay '10 ms'",
    ):
        assert said in text, said
    assert max(map(len, text.splitlines())) <= 140
    assert text.count("\n") < 70
    assert card.shaping is None
    assert [row.tool for row in card.rows] == [0.0, 1.0]
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


def test_the_command_prints_the_card_and_writes_its_forms(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("passiflex.cards.card", lambda *_, **__: found())
    result = Shell(monkeypatch, capsys)("card", "so101", "--rate", "100 Hz", "--out", tmp_path / "cards")
    assert result.status == 0, result.err
    assert card_text(found()).splitlines()[4] in result.out
    assert sorted(p.name for p in (tmp_path / "cards").iterdir()) == ["so101.html", "so101.pdf", "so101.txt"]


def test_what_makes_no_sense_is_said() -> None:
    for arguments, message in (
        (("so10", 100), "unknown robot; got 'so10'.*try 'so101'"),
        (("so101", 0), "rate"),
        (("so101", "100 m"), "rate"),
        (("so101", 100, -1), "delay"),
    ):
        with pytest.raises(PassiflexError, match=message):
            pf.card(*arguments)
