"""A watch for the carts of `carts.py`: how often it saw what and when, and sums of all that it was shown."""

import casadi as cs

from passiflex.native import Watch

SIZE, LEAST, ELAPSED = 7, 1.5, 6
"""Size of its memory, what its least position starts at, and the number of y that counts the seconds itself."""


def watch():
    """Remember looks, glances, Σ time, worst |time − elapsed|, least y₀, Σ p₁ (command, c, z), Σ p₁ v at glances."""
    w, time, y, p = cs.SX.sym("w", SIZE), cs.SX.sym("time"), cs.SX.sym("y", 7), cs.SX.sym("p", 2)
    command, c, z = cs.SX.sym("command", 2), cs.SX.sym("c", 3), cs.SX.sym("z", 4)
    wrong = cs.fmax(w[3], cs.fabs(time + p[0] - y[ELAPSED]))
    least = cs.fmin(w[4], y[0] - LEAST)
    seen = p[1] * cs.sum1(cs.vertcat(command, c, z))
    look = cs.vertcat(w[0] + 1, w[1], w[2] + time, wrong, least, w[5] + seen, w[6])
    glance = cs.vertcat(w[0], w[1] + 1, w[2] + time, wrong, least, w[5], w[6] + p[1] * y[2])
    return Watch(
        cs.Function("look", [w, time, y, command, c, z, p], [look]),
        cs.Function("glance", [w, time, y, p], [glance]),
    )


def step_watch():
    """Return one for `FixedStep` with two states and one quadrature: looks, Σ time, Σ (y, u, p)."""
    w, time, y, u, p = (
        cs.SX.sym("w", 3),
        cs.SX.sym("time"),
        cs.SX.sym("y", 3),
        cs.SX.sym("u", 2),
        cs.SX.sym("p", 1),
    )
    after = cs.vertcat(w[0] + 1, w[1] + time, w[2] + cs.sum1(y) + cs.sum1(u) + p)
    return cs.Function("step_watch", [w, time, y, u, p], [after])
