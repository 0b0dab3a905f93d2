"""Where in the box a loop gets worse: the derivative of its modes' moduli by each of the box's coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.stability.linear_loop import LinearLoop
from passiflex.stability.loop_at_rest import standing
from passiflex.stability.modes import self_motion, trembles
from passiflex.stability.timing import Timing

if TYPE_CHECKING:
    from passiflex.limits.margin_box import MarginBox, Member

Array = NDArray[np.float64]
Gains = Mapping[str, Array]

FOLLOWED, SLOW, LEADING, DOMINANT = 16, 4, 10, 2
"""Modes that tremble and slower ones whose slopes are taken, those of the first that are followed to corners, and
those that are followed uphill."""
STEP = 1e-3
"""Of the differences by the box's coordinates."""


class Pairs(NamedTuple):
    """Left and right vectors (N, m) of a period's map, and what the law makes of the right ones at its sample."""

    timing: Timing
    left: NDArray[Any]
    right: NDArray[Any]
    ran: NDArray[Any]


def steepest(box: MarginBox, member: Member, gains: Gains, *, dominant: bool = False) -> list[Array]:
    """Return ∂|λ|/∂off of the modes that could grow most within the box, or of those that are largest here."""
    loop, late = box.loop(member)
    timing = Timing.of(loop.problem.period, late, int(late / loop.problem.period + 1e-9) + 1)
    flow, ran = loop.flow(timing), loop.runs(timing, gains)
    parts: Any = scipy.linalg.eig(flow @ ran, left=True, check_finite=False)
    values, left, right = parts
    sizes = np.where(self_motion(values, right, loop.problem.period, loop.task_jacobian), 0.0, np.abs(values))
    sizes = np.where(values.imag < 0, 0.0, sizes)  # of a pair one is enough
    fast = trembles(values, loop.problem.period)
    danger = np.where(fast | (sizes >= 1), sizes, 0.0)
    quick, slow = np.argsort(-danger), np.argsort(-np.where(fast, 0.0, sizes))
    chosen = quick[:DOMINANT] if dominant else np.concatenate([quick[:FOLLOWED], slow[:SLOW]])
    values, left, right, sizes = values[chosen], left[:, chosen], right[:, chosen], sizes[chosen]
    scale = np.sum(left.conj() * right, axis=0)
    scale = np.where(np.abs(scale) < 1e-12, np.inf, scale)
    change = _changes(box, member, gains, Pairs(timing, left, right, ran @ right)) / scale
    slopes = np.real(change * values.conj()) / np.maximum(sizes, 1e-12)
    if dominant:
        return list(slopes.T)
    reach = sizes + np.abs(slopes).sum(axis=0)
    first, last = np.argsort(-reach[:FOLLOWED])[:LEADING], FOLLOWED + np.argsort(-reach[FOLLOWED:])[:1]
    return [slopes[:, i] for i in np.concatenate([first, last])]


def _changes(box: MarginBox, member: Member, gains: Gains, pairs: Pairs) -> NDArray[Any]:
    """Return the derivative of leftᴴ A right by each coordinate of the box, for each pair of columns."""
    problem, n, (loop, _) = box.problems[member.posture], box.n, box.loop(member)
    (timing, left, right, ran), n_x = pairs, loop.x.size
    flow, by_plant = loop.flow(timing), loop.by_plant(timing, left, ran)
    told = slice(n_x, n_x + loop.remembered.size + n)
    pulled = (left.conj().T @ flow)[:, told]  # what the law leaves, as the modes see it a period later
    steps = np.where(np.array(member.off) <= 0, STEP, -STEP)
    out = np.zeros((5 * n + 1, left.shape[1]), dtype=complex)
    beside = [_beside(member, j, steps[j]) for j in range(5 * n + 1)]
    at = [standing(problem, box.angles(m), box.plant(m)) for m in beside]
    plants = loop.plants(at) - loop.plant
    for j, (other, h) in enumerate(zip(at, steps, strict=True)):
        if j == 4 * n:
            late = Timing.of(timing.period, box.late(beside[j]), timing.lined)
            out[j] = np.sum(left.conj() * ((loop.flow(late) - flow) @ ran), axis=0) / h
            continue
        if j > 4 * n:
            moved = LinearLoop(problem, other).runs(timing, gains)[told] @ right - ran[told]
        else:
            moved = loop.heard(other, timing.period, timing.period, gains) @ right[:n_x]
        out[j] = (np.tensordot(by_plant, plants[j], 2) + np.sum(pulled.T * moved, axis=0)) / h
    return out


def _beside(member: Member, coordinate: int, step: float) -> Member:
    """Return a member with one coordinate moved."""
    off = list(member.off)
    off[coordinate] += step
    return member._replace(off=tuple(off))
