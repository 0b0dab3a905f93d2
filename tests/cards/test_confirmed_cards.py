"""Three cards against the nonlinear loop: twenty random robots inside of what they call safe, and twenty beyond."""

from __future__ import annotations

import math

import numpy as np
import pytest

import passiflex as pf
from passiflex.cards import Card
from passiflex.cards.border import stiffness_of
from passiflex.cards.setting import SCALES, Setting
from passiflex.limits.confirmation import VISIBLE, disturbed, growth
from passiflex.limits.margin_box import Member

POINTS = 20
Gains = dict[str, np.ndarray]


def grows(s: Setting, member: Member, gains: Gains) -> bool:
    return growth(disturbed(s.simulated(member, gains))) >= 1


def drawn(s: Setting, rng: np.random.Generator) -> Member:
    """Return a robot of the box: a corner or anywhere."""
    off = rng.uniform(-1, 1, 5 * s.robot.n + 1)
    off = np.sign(off) if rng.random() < 0.5 else off
    return Member(int(rng.integers(len(s.postures))), tuple(off.tolist()))


def inside(card: Card, s: Setting, rng: np.random.Generator) -> Gains:
    """Return gains as the card's first row has them: half of its K_x, D_x anywhere in the window."""
    b = card.bare.border
    gains = s.gains(*stiffness_of(b.part, b.stiffness / 2))
    D = np.full(len(gains["damping"]), b.damping.beside)
    D[:3] = math.exp(rng.uniform(math.log(b.damping.least), math.log(b.damping.most)))
    return gains | {"damping": np.diag(D)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "rate", "delay"), [("fr3", 1000, 1e-3), ("ur5e", 500, 2e-3), ("so101", 200, 5e-3)]
)
def test_a_card_is_confirmed_on_both_sides(name: str, rate: float, delay: float) -> None:
    card, rng = pf.card(name, rate, delay), np.random.default_rng(2)
    s = Setting(card.robot, card.rate, card.delay, card.postures, card.task)
    for _ in range(POINTS):
        gains, member = inside(card, s, rng), drawn(s, rng)
        assert s.radius(member, gains) < 1
        assert not grows(s, member, gains)
    told = 0
    for _ in range(50 * POINTS):
        k = card.bare.border.stiffness * 10 ** rng.uniform(0.1, 1)
        gains = s.gains(*stiffness_of("translation", k), SCALES[int(rng.integers(len(SCALES)))])
        member = drawn(s, rng)
        if s.radius(member, gains) < VISIBLE:
            continue  # this robot of the box bears it: the border is that of the worst
        assert grows(s, member, gains)
        told += 1
        if told == POINTS:
            return
    pytest.fail(f"{told} points beyond the border were found")
