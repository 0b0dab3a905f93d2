"""Where in the box a loop gets worse: the derivative of its modes' moduli by each of the box's coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from passiflex.stability.linear_loop import LinearLoop, product
from passiflex.stability.loop_at_rest import standing
from passiflex.stability.modes import self_motion, trembles
from passiflex.stability.timing import Timing

if TYPE_CHECKING:
    from passiflex.limits.margin_box import MarginBox, Member

Array = NDArray[np.float64]
NODES, WEIGHTS = (np.polynomial.legendre.leggauss(4)[0] + 1) / 2, np.polynomial.legendre.leggauss(4)[1] / 2
"""Of a quadrature over 0 to 1."""
Gains = Mapping[str, Array]

FOLLOWED, SLOW, LEADING, DOMINANT = 16, 4, 10, 2
"""Modes that tremble and slower ones whose slopes are taken, those of the first that are followed to corners, and
those that are followed uphill."""
STEP = 1e-3
"""Of the differences by the box's coordinates."""


class Pairs(NamedTuple):
    """Left and right vectors (N, m) of a period's map, and what the law makes of the right ones at its sample.

    Attributes
    ----------
    due: Whether the outer loop runs in that period.
    """

    timing: Timing
    due: bool
    left: NDArray[Any]
    right: NDArray[Any]
    ran: NDArray[Any]


def steepest(box: MarginBox, member: Member, gains: Gains, *, dominant: bool = False) -> list[Array]:
    """Return ∂|λ|/∂off of the modes that could grow most within the box, or of those that are largest here."""
    loop, late = box.loop(member)
    timing = Timing.of(loop.problem.period, late, int(late / loop.problem.period + 1e-9) + 1)
    flow, runs = loop.flow(timing), [loop.runs(timing, gains, due=due) for due in loop.phases]
    parts: Any = scipy.linalg.eig(product([flow @ ran for ran in runs]), left=True, check_finite=False)
    values, left, right = parts
    sizes = np.where(self_motion(values, right, loop.cycle(), loop.task_jacobian), 0.0, np.abs(values))
    sizes = np.where(values.imag < 0, 0.0, sizes)  # of a pair one is enough
    fast = trembles(values, loop.cycle())
    danger = np.where(fast | (sizes >= 1), sizes, 0.0)
    quick, slow = np.argsort(-danger), np.argsort(-np.where(fast, 0.0, sizes))
    chosen = quick[:DOMINANT] if dominant else np.concatenate([quick[:FOLLOWED], slow[:SLOW]])
    values, left, right, sizes = values[chosen], left[:, chosen], right[:, chosen], sizes[chosen]
    scale = np.sum(left.conj() * right, axis=0)
    scale = np.where(np.abs(scale) < 1e-12, np.inf, scale)
    change: Any = 0
    for i, (due, ran) in enumerate(zip(loop.phases, runs, strict=True)):
        before, after = [flow @ r for r in runs[:i]], [flow @ r for r in runs[i + 1 :]]
        here = product([np.eye(len(flow)), *before]) @ right
        seen = product([np.eye(len(flow)), *after]).T @ left
        change = change + _changes(box, member, gains, Pairs(timing, due, seen, here, ran @ here))
    change = change / scale
    slopes = np.real(change * values.conj()) / np.maximum(sizes, 1e-12)
    if dominant:
        return list(slopes.T)
    reach = sizes + np.abs(slopes).sum(axis=0)
    first, last = np.argsort(-reach[:FOLLOWED])[:LEADING], FOLLOWED + np.argsort(-reach[FOLLOWED:])[:1]
    return [slopes[:, i] for i in np.concatenate([first, last])]


def _changes(box: MarginBox, member: Member, gains: Gains, pairs: Pairs) -> NDArray[Any]:
    """Return the derivative of leftᴴ A right by each coordinate of the box, for each pair of columns."""
    problem, n, (loop, _) = box.problems[member.posture], box.n, box.loop(member)
    (timing, due, left, right, ran), n_x = pairs, loop.x.size
    flow, by_plant = loop.flow(timing), _by_plant(loop, timing, left, ran)
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
            moved = LinearLoop(problem, other).runs(timing, gains, due=due)[told] @ right - ran[told]
        else:
            moved = loop.heard(other, timing.period, gains, due=due) @ right[:n_x]
        out[j] = (np.tensordot(by_plant, plants[j], 2) + np.sum(pulled.T * moved, axis=0)) / h
    return out


def _by_plant(loop: LinearLoop, timing: Timing, left: NDArray[Any], ran: NDArray[Any]) -> NDArray[Any]:
    """Return the derivative of leftᴴ `flow` ran by the entries of [A B] of the plant (m, N, N + n).

    With ẋ = A x + B u it is ∫ p (x, u)ᵀ dt, where ṗ = −Aᵀ p leads to `left` at the period's end; by Gauss's
    quadrature. Columns of `left` and of `ran`, what the law leaves of a vector, go in pairs.
    """
    n, n_x = loop.n, loop.x.size
    told = n_x + loop.remembered.size
    p_end, x = left[:n_x].conj().T, ran[:n_x]
    pieces = [(timing.whole + 1, timing.part), (timing.whole, 1 - timing.part)]
    out = np.zeros((left.shape[1], n_x, n_x + n), dtype=complex)
    for i, (ago, share) in enumerate(pieces):
        if not share:
            continue
        long, u = share * timing.period, ran[told + ago * n : told + (ago + 1) * n]
        rest = loop.held(pieces[1][1] * timing.period)[0] if i == 0 else np.eye(n_x)
        for node, mirrored, weight in zip(NODES, NODES[::-1], WEIGHTS, strict=True):
            moved, pushed = loop.held(node * long)
            p = p_end @ rest @ loop.held(mirrored * long)[0]
            here = np.concatenate([moved @ x + pushed @ u, u])
            out += weight * long * np.einsum("mi,jm->mij", p, here)
        moved, pushed = loop.held(long)
        x = moved @ x + pushed @ u
    return out


def _beside(member: Member, coordinate: int, step: float) -> Member:
    """Return a member with one coordinate moved."""
    off = list(member.off)
    off[coordinate] += step
    return member._replace(off=tuple(off))
