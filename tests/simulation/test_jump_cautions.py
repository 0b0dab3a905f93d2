"""A reference that jumps far at once is told before the run, with what it stores."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from passiflex.problems.resolution import resolve
from passiflex.simulation.cautions import cautions
from passiflex.simulation.jump_cautions import far_jumps, racing
from passiflex.simulation.turn_cautions import far_turns
from work import calls
from worlds import world


def said(reference: Any) -> str:
    return "\n".join(far_jumps(resolve(world(reference=reference))))


def test_a_far_jump_is_told_with_its_energy_and_a_near_one_is_not() -> None:
    far = {"rows": "t,x,y,z\n0.1,0,0,0\n0.2,0.4,0,0.3\n", "relative": True, "between": "held"}
    assert said(far) == (
        "at 0.2 s the reference jumps by 0.5 m at once, which stores 25 J in the spring of a hand that stands still; "
        "move there, or begin a table where the hand is (relative: true takes its rows from there)"
    )
    assert not said(far | {"between": "minimum_jerk"})
    assert not said([{"at": 0.1, "kind": "step", "by": [0, 0, 0.2]}])
    assert far_jumps(resolve(world(reference=far)))[0] in cautions(resolve(world(reference=far)))


def test_a_table_of_other_units_is_found_by_its_first_row() -> None:
    """Millimetres."""
    assert said({"rows": "t,x,y,z\n0,400,0,500\n1,400,0,500\n"}).startswith("at 0 s the reference jumps by 6")


def test_a_table_of_other_units_is_found_by_how_fast_it_goes() -> None:
    """Millimetres from where the hand is, linear from row to row: nothing jumps."""
    table = {"rows": "t,x,y,z\n0,0,0,0\n0.1,0,0,-80\n", "relative": True}
    assert not said(table)
    (line,) = racing(resolve(world(reference=table)))
    assert line.startswith(
        "from 0 s on the reference moves by 80 m in 0.1 s, 800 m/s, which no hand can follow;"
    )
    assert line in cautions(resolve(world(reference=table)))
    metres = {"rows": "t,x,y,z\n0,0,0,0\n0.1,0,0,-0.08\n", "relative": True}
    assert racing(resolve(world(reference=metres))) == ()
    assert racing(resolve(world())) == ()


@pytest.mark.parametrize("ask", [far_jumps, far_turns, racing])
def test_the_work_grows_as_the_number_of_rows(ask: Any) -> None:
    law = {"task": "pose", "stiffness": {"rotation": [9, 0, 9]}, "damping": {"rotation": [1, 0, 1]}}
    law |= {"regularisation": 0.01}

    def taken(number: int) -> int:
        t = 0.5 * np.arange(number) / number
        rows = "t,x,y,z\n" + "".join(f"{a!r},{a / 10!r},0,0\n" for a in t.tolist())
        changes: Any = (
            {} if ask is far_jumps else {"law": law, "robot": "iiwa14", "posture": [0, 0.6, 0, -1.2, 0, 1, 0]}
        )
        problem = resolve(world(reference={"rows": rows, "relative": True}, **changes))
        return calls(lambda: ask(problem))

    assert taken(800) < 5 * taken(200)
