"""Dry friction that sticks: a bristle that is bent until it slips, and keeps exact books of it.

    f = σ z,   ż = v − λ z,   λ ≥ 0

z is by how much the bristle is bent, ½ σ z² what it stores, and σ λ z² ≥ 0 what it loses, whatever λ is: it never
gives what it does not have, however the limit f_s of the force changes meanwhile. λ is zero below a share of the limit,
so that it sticks for good and does not creep; where z has reached the limit it goes along with v, so that the force is
f_s exactly while it slides; and a bristle bent beyond a limit that has fallen comes back to it within a time.

After Dupont, Hayward, Armstrong, Altpeter, "Single state elastoplastic friction models", IEEE Trans. Automatic Control
47(5), 2002, for one direction or three.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as cs

STICKS = 0.5
"""Share of the limit below which a bristle holds for good."""
RETURN = 5e-4
"""Time [s] within which a bristle that is bent beyond its limit comes back to it."""
SMALL = 1e-12
"""Bent by so little [m, rad], a bristle has no direction."""


class Bent(NamedTuple):
    """How a bristle moves: λ z, its part that slips, and λ z · z ≥ 0, of which σ times is lost."""

    slip: cs.SX
    lost: cs.SX


def slipping(z: cs.SX, v: cs.SX, limit: cs.SX) -> Bent:
    """Return how a bristle that is bent by z [m, rad] slips at a velocity v, with z at most `limit` ≥ 0."""
    length = cs.sqrt(cs.sumsqr(z) + SMALL**2)
    direction = z / length
    share = length / (limit + SMALL)
    s = cs.fmin(cs.fmax((share - STICKS) / (1 - STICKS), 0), 1)
    along = cs.fmax(cs.dot(direction, v), 0)
    rate = s**2 * along + cs.fmax(length - limit, 0) / RETURN
    slip = rate * direction
    return Bent(slip, cs.dot(slip, z))
