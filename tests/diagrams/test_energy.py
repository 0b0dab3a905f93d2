"""The energies that are shown add up, and are those of the balances; the books show what the tank is worth."""

from __future__ import annotations

import numpy as np
import pytest

from diagrams.seen import KINDS_OF_RUN, altered, continuous, held_back, made_up, rigid, without
from passiflex.diagrams import Panel, Viewed, panels
from passiflex.passivity import available_energy, claimed_balance, link_balance, overclaimed, port_tank
from passiflex.simulation import Run


def shown(run: Run, choice: str = "energies", others: tuple[Viewed, ...] = ()) -> Panel:
    return next(p for p in panels("energy", Viewed(run, "it"), others) if p.choice == choice)


def by_role(panel: Panel) -> dict[str, np.ndarray]:
    return {curve.role: curve.values for curve in panel.curves}


@pytest.mark.parametrize("kind", KINDS_OF_RUN)
def test_the_total_is_the_sum_of_the_parts_that_are_shown(kind: str) -> None:
    run = KINDS_OF_RUN[kind]()
    energies = by_role(shown(run))
    size = np.abs(energies["total"]).max()
    parts = energies["kinetic"] + energies["spring"] + energies.get("tank", 0.0)
    np.testing.assert_allclose(energies["total"], parts, rtol=0, atol=1e-12 * size)
    if run.has_tank:
        np.testing.assert_allclose(energies["total"], energies["robot"] + energies["tank"], atol=1e-12 * size)
    assert ("tank" in energies, "robot" in energies) == (run.has_tank, run.has_tank)


@pytest.mark.parametrize("kind", ["continuous", "rigid"])
def test_in_continuous_time_the_total_is_that_of_the_laws_own_books(kind: str) -> None:
    """𝓗₂ of (28), whatever carries the weight; V and V_γ are about 1e2 J each, and cancel."""
    run = KINDS_OF_RUN[kind]()
    total = claimed_balance(run).total
    np.testing.assert_allclose(by_role(shown(run))["total"], total, rtol=0, atol=1e-12)
    assert total.max() - total.min() > 1e-2


def test_of_a_sampled_run_the_total_moves_by_what_comes_in_and_what_the_tank_overclaims() -> None:
    """With the tank at the port in place of the claimed one, only the environment moves it: the links' balance."""
    run = held_back()
    total = by_role(shown(run))["total"]
    moved = total - total[0] - run["external_energy"]
    error = 10 * link_balance(run).worst + 1e-12
    np.testing.assert_allclose(moved, overclaimed(run) - overclaimed(run)[0], rtol=0, atol=error)


def test_books_are_level_claimed_level_there_and_what_may_still_be_given() -> None:
    run = held_back()
    books = shown(run, "books")
    values = by_role(books)
    np.testing.assert_array_equal(values["tank"], run["tank_energy"])
    np.testing.assert_array_equal(values["true"], port_tank(run))
    np.testing.assert_array_equal(values["available"], available_energy(run))
    assert {(level.value, level.label) for level in books.levels} == {
        (0.1, "T_min, floor of the tank"),
        (0.0, "nothing left"),
    }
    assert [level.value for level in shown(run).levels] == [0.1]


def test_a_law_without_a_tank_has_no_level_to_show() -> None:
    books = shown(rigid(), "books")
    assert list(by_role(books)) == ["available"]
    assert [level.value for level in books.levels] == [0.0]
    assert shown(rigid()).curves[0].label == "total H₁"


def test_compared_runs_show_total_and_tank() -> None:
    others = (Viewed(rigid(), "rigid"), Viewed(held_back(), "poor"))
    compared = [c for c in shown(continuous(), others=others).curves if c.role.startswith("other")]
    assert [(c.label, c.role) for c in compared] == [
        ("total, rigid", "other 1 total"),
        ("total, poor", "other 2 total"),
        ("tank, poor", "other 2"),
    ]
    np.testing.assert_array_equal(compared[2].values, held_back()["tank_energy"])
    np.testing.assert_array_equal(compared[2].time, held_back().time)
    assert not any(c.role.startswith("other") for c in shown(continuous(), "books", others).curves)


def test_the_weight_is_named_where_there_is_one() -> None:
    assert by_label(continuous()) == "springs: Cartesian, joints, weight carried"
    zero = np.zeros(40)
    assert by_label(made_up(potential_energy=zero, gravity_storage=zero)) == "springs: Cartesian, joints"


def by_label(run: Run) -> str:
    return next(c.label for c in shown(run).curves if c.role == "spring")


def test_what_is_missing_is_left_out_and_the_rest_is_shown() -> None:
    run = without(made_up(), "tank_energy", "compensated_energy")
    assert list(by_role(shown(run))) == ["robot", "kinetic", "spring"]
    assert [p.choice for p in panels("energy", Viewed(run, "it"))] == ["energies"]
    bare = without(run, "link_kinetic_energy", "cartesian_spring_energy")
    assert panels("energy", Viewed(bare, "it")) == ()


def test_a_run_that_does_not_say_whether_it_has_a_tank_shows_what_needs_none() -> None:
    run = made_up()
    del run.data.attrs["has_tank"]
    assert list(by_role(shown(run))) == ["kinetic", "spring"]


def test_a_gap_stays_a_gap_and_no_more() -> None:
    """Also in what may still be given, whose budget is a minimum over the run."""
    run = altered(continuous())
    run.data["cartesian_spring_energy"][7] = np.nan
    for choice in ("energies", "books"):
        for role, values in by_role(shown(run, choice)).items():
            expected = 0 if role in ("tank", "kinetic") else 1
            assert np.isnan(values).sum() == expected, role
            assert not expected or np.isnan(values[7])
    whole, broken = by_role(shown(continuous(), "books")), by_role(shown(run, "books"))
    np.testing.assert_array_equal(np.delete(broken["available"], 7), np.delete(whole["available"], 7))


def test_where_the_start_is_lost_nothing_is_claimed_of_the_budget() -> None:
    run = altered(continuous())
    run.data["cartesian_spring_energy"][0] = np.nan
    assert list(by_role(shown(run, "books"))) == ["tank"]
