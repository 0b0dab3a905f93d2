"""Where the box leads uphill, against differences of eigenvalues of whole loops."""

from __future__ import annotations

import numpy as np
import pytest

from passiflex.limits.box_slopes import steepest
from passiflex.limits.margin_box import MarginBox, Member
from passiflex.simulation import resolve
from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.loop_at_rest import standing
from passiflex.stability.modes import trembles
from worlds import world


@pytest.mark.parametrize("delay", [0.0, 0.4e-3, 1.3e-3])
@pytest.mark.parametrize("inner", ["plain", "matched"])
def test_a_slope_is_what_the_modulus_does(inner: str, delay: float) -> None:
    """Of the largest mode that trembles: B, K, D and inertia of each joint, delay and posture, also at a corner."""
    problem = resolve(world(reference=[], control={"rate": 1000, "delay": delay, "inner_loop": inner}))
    box, h = MarginBox((problem,), 0.2), 1e-4
    rng = np.random.default_rng(3)
    for off in (np.zeros(11), np.sign(rng.uniform(-1, 1, 11))):
        member = Member(0, tuple(off.tolist()))

        def modes(member: Member) -> np.ndarray:
            there = LinearLoop(problem, standing(problem, box.angles(member), box.plant(member)))
            return np.linalg.eigvals(there.matrix(None, box.late(member), {}, lined=3))

        values = modes(member)
        fast = np.abs(np.where(trembles(values, 1e-3) & (values.imag >= 0), values, 0))
        leading = values[np.argmax(fast)]
        found = steepest(box, member, {}, dominant=True)[0]
        for j in range(11):
            inward = off.copy()
            inward[j] -= h if off[j] > 0 else -h
            after = modes(Member(0, tuple(inward.tolist())))
            change = np.abs(after[np.argmin(np.abs(after - leading))]) - np.abs(leading)
            assert change / (inward[j] - off[j]) == pytest.approx(
                found[j], rel=0.02, abs=0.01 * np.abs(found).max()
            )
