"""Powers and energies at the ports, and the torques of the joints, are the signals of the run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagrams.seen import EVERYWHERE, KINDS_OF_RUN, altered, continuous, held_back, made_up, rigid, without
from passiflex.diagrams import KINDS, Panel, Viewed, panels
from passiflex.errors import NameUnknownError
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run

PORTS = ("external", "motor", "joint", "joint_loss", "friction")
ROLES = ("environment", "motor", "joint", "loss", "friction")


def shown(kind: str, run: Run, others: tuple[Viewed, ...] = ()) -> dict[str, Panel]:
    return {p.choice: p for p in panels(kind, Viewed(run, "it"), others)}


def by_role(panel: Panel) -> dict[str, np.ndarray]:
    return {curve.role: curve.values for curve in panel.curves}


def test_another_kind_is_refused_with_the_names_of_the_kinds() -> None:
    assert KINDS == ("energy", "port", "tracking", "torque", "contact")
    with pytest.raises(NameUnknownError) as error:
        panels("torqe", Viewed(made_up(), "it"))
    assert str(error.value) == (
        "unknown kind of diagram; got 'torqe'; needs one of contact, energy, port, torque, tracking; try 'torque'"
    )


@pytest.mark.parametrize("kind", EVERYWHERE)
@pytest.mark.parametrize("of", KINDS_OF_RUN)
def test_every_diagram_says_what_it_is_of(kind: str, of: str) -> None:
    found = panels(kind, Viewed(KINDS_OF_RUN[of](), "it"))
    assert found
    assert len({panel.choice for panel in found}) == len(found)
    for panel in found:
        assert panel.kind == kind
        assert panel.title
        assert panel.unit in ("J", "W", "m", "rad", "1", "N m")
        assert len({curve.role for curve in panel.curves}) == len(panel.curves)
        for curve in panel.curves:
            assert curve.time.shape == curve.values.shape


UNITS = {
    "energy": {"energies": "J", "books": "J"},
    "port": {"powers": "W", "powers of the law": "W", "energies": "J", "energies of the law": "J"},
    "tracking": {"x": "m", "y": "m", "z": "m", "distance": "m", "orientation": "rad"},
    "torque": {"all joints": "1", "joint 1": "N m"},
}


@pytest.mark.parametrize("kind", EVERYWHERE)
def test_every_diagram_has_the_unit_of_its_numbers(kind: str) -> None:
    powers = {f"{name}_power": ("time", np.ones(40)) for name in ("reference", "drawn", "spilled")}
    run = made_up(joints=1)
    run = Run(run.data.assign(powers))
    assert {panel.choice: panel.unit for panel in panels(kind, Viewed(run, "it"))} == UNITS[kind]


@pytest.mark.parametrize(
    ("choice", "suffix", "unit"), [("powers", "power", "W"), ("energies", "energy", "J")]
)
def test_ports_are_the_signals_with_their_sign_in_the_name(choice: str, suffix: str, unit: str) -> None:
    run = made_up()
    panel = shown("port", run)[choice]
    assert panel.unit == unit
    for name, role in zip(PORTS, ROLES, strict=True):
        np.testing.assert_array_equal(by_role(panel)[role], run[f"{name}_{suffix}"])
    assert [curve.label for curve in panel.curves] == [
        "environment, into the robot",
        "motor torque, into the motors",
        "joints, into the links",
        "joint dampers, lost",
        "motor friction, lost",
    ]


def test_the_labels_have_the_signs_of_the_robots_balance() -> None:
    """What comes in less what is lost is the change of what is stored, (4): so the signs are as they are named."""
    run = continuous()
    flows = by_role(shown("port", run)["energies"])
    stored = sum(
        run[name]
        for name in (
            "link_kinetic_energy",
            "motor_kinetic_energy",
            "joint_spring_energy",
            "potential_energy",
        )
    )
    change = flows["environment"] + flows["motor"] - flows["loss"]
    np.testing.assert_allclose(stored - stored[0], change, rtol=0, atol=1e-6)


def test_the_laws_own_books() -> None:
    continuous_books, sampled_books = shown("port", continuous()), shown("port", held_back())
    assert list(by_role(continuous_books["powers of the law"])) == ["moving reference", "drawn", "spilled"]
    assert "powers of the law" not in sampled_books  # a period is booked at once
    booked = by_role(sampled_books["energies of the law"])
    assert list(booked) == ["moving reference", "granted", "drawn", "refilled", "spilled"]
    run = held_back()
    level = run["tank_energy"][0] + booked["refilled"] - booked["granted"] - booked["drawn"]
    start = booked["refilled"][0] - booked["granted"][0] - booked["drawn"][0]
    np.testing.assert_allclose(level - start, run["tank_energy"], rtol=0, atol=1e-12)


def test_a_law_without_a_tank_draws_nothing_from_it() -> None:
    books = shown("port", rigid())["energies of the law"]
    assert [(c.role, c.label) for c in books.curves] == [
        ("moving reference", "reference, into the spring"),
        ("spilled", "dampers of the law, lost"),
    ]


def test_a_diagram_in_which_nothing_ever_flows_is_left_out() -> None:
    zero = np.zeros(40)
    names = ("reference", "granted", "drawn", "refilled", "spilled")
    still = made_up(**{f"{name}_energy": zero for name in names})
    assert list(shown("port", still)) == ["powers", "energies"]
    gap = altered(still)
    gap.data["drawn_energy"][3] = np.nan  # of which nothing is known
    assert "energies of the law" in shown("port", gap)


def test_torques_as_shares_of_their_limits() -> None:
    run = made_up(joints=9)
    panel = shown("torque", run)["all joints"]
    assert (panel.unit, [level.value for level in panel.levels]) == ("1", [1.0, -1.0])
    for i, curve in enumerate(panel.curves):
        assert curve.label == f"joint {i + 1}"
        np.testing.assert_array_equal(curve.values, run["tau_m"][:, i] / run["torque_limit"][i])
    assert [curve.role for curve in panel.curves][-2:] == ["joint 8", "joint 1"]


def test_each_joint_has_both_its_torques_and_its_limits() -> None:
    run = made_up()
    found = shown("torque", run)
    assert list(found) == ["all joints", *(f"joint {i}" for i in range(1, 8))]
    panel = found["joint 3"]
    np.testing.assert_array_equal(by_role(panel)["motor"], run["tau_m"][:, 2])
    np.testing.assert_array_equal(by_role(panel)["joint"], run["tau_a"][:, 2])
    limit = float(run["torque_limit"][2])
    assert [(level.value, level.label) for level in panel.levels] == [
        (limit, f"limit +{limit:.4g} N m"),
        (-limit, f"limit −{limit:.4g} N m"),
    ]
    assert panel.unit == "N m"


def test_a_joint_that_slides_has_a_force() -> None:
    run = made_up()
    run.data["torque_limit"].attrs["units"] = "N"
    panel = shown("torque", run)["joint 1"]
    assert (panel.title, panel.unit, panel.levels[0].label) == ("force, joint 1", "N", "limit +1 N")
    assert [c.label for c in panel.curves] == ["motor force τ_m", "joint force τ_a on the link"]


def test_where_some_joints_slide_each_has_its_own_unit() -> None:
    chain = chain_of(continuous())
    assert chain is not None
    arm = replace(chain, joints=(chain.joints[0]._replace(kind="prismatic"), *chain.joints[1:]))
    run = altered(without(continuous(), "position"), robot_description=arm.to_urdf())
    run.data["torque_limit"].attrs["units"] = "N m or N"
    found = shown("torque", run)
    assert [(found[f"joint {i}"].unit, found[f"joint {i}"].title) for i in (1, 2, 3)] == [
        ("N", "force, joint 1"),
        ("N m", "torque, joint 2"),
        ("N m", "torque, joint 3"),
    ]
    unknown = altered(run, robot_description="", scenario="")
    assert shown("torque", unknown)["joint 1"].unit == "N m or N"


def test_a_joint_without_a_limit_has_no_share_of_it() -> None:
    limits = np.array([2.0, np.inf, 0.0, np.nan, 2, 2, 2])
    found = shown("torque", made_up(torque_limit=limits))
    assert [c.label for c in found["all joints"].curves] == ["joint 1", "joint 5", "joint 6", "joint 7"]
    assert [found[f"joint {i}"].levels for i in (2, 3, 4)] == [(), (), ()]
    assert "all joints" not in shown("torque", without(made_up(), "torque_limit"))


def test_compared_runs_show_the_motor_torque_of_the_joints_that_they_have() -> None:
    small = made_up(joints=2)
    found = shown("torque", made_up(), (Viewed(small, "small"),))
    assert [c.label for c in found["joint 2"].curves][-1] == "τ_m, small"
    np.testing.assert_array_equal(by_role(found["joint 2"])["other 1"], small["tau_m"][:, 1])
    assert "other 1" not in by_role(found["joint 3"])


def test_missing_torques_and_gaps() -> None:
    run = altered(without(made_up(), "tau_a"))
    run.data["tau_m"][5, 1] = np.nan
    found = shown("torque", run)
    assert list(by_role(found["joint 1"])) == ["motor"]
    assert np.flatnonzero(np.isnan(by_role(found["joint 2"])["motor"])).tolist() == [5]
    assert shown("torque", without(run, "tau_m")) == {}
    assert shown("port", without(made_up(), *(f"{n}_power" for n in PORTS))).keys() == {
        "energies",
        "energies of the law",
    }
