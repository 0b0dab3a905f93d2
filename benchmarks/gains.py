"""How long the answers to "which gains" take: `limits` without a picture, and `recommend` over the whole box.

One robot with 7 joints at 7 postures, warm (everything compiled), on one core: CPU seconds, and how many members of
the box and gains were looked at. Run it on an idle machine: `OMP_NUM_THREADS=1 python benchmarks/gains.py`.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import passiflex as pf
from passiflex.limits import limit_map
from passiflex.limits.recommend_for import recommend_for
from passiflex.stability.linear_loop import LinearLoop

RUNS = 2
"""The first compiles; the last one counts."""


def timed(name: str, work: Callable[[], object]) -> float:
    """Print and return the CPU seconds of a chunk of work, and how many radii it took."""
    radii = 0
    matrix = LinearLoop.matrix

    def counted(self: LinearLoop, *told: object, **named: object) -> object:
        nonlocal radii
        radii += 1
        return matrix(self, *told, **named)  # type: ignore[arg-type]

    LinearLoop.matrix = counted  # type: ignore[method-assign, assignment]
    try:
        for _ in range(RUNS):
            radii, start = 0, time.process_time()
            work()
            seconds = time.process_time() - start
    finally:
        LinearLoop.matrix = matrix  # type: ignore[method-assign]
    print(
        f"{name:32} {seconds:6.1f} s CPU, {radii} maps of a period, {1e3 * seconds / max(radii, 1):.2f} ms each"
    )
    return seconds


if __name__ == "__main__":
    scenario = pf.shipped_scenario("fig1_sampled")
    own = timed("limits, no picture", lambda: limit_map(scenario, pictured=False))
    for inner in ("plain", "matched"):
        timed(f"recommend, {inner}", lambda inner=inner: recommend_for(scenario, inner_loop=inner))
    both = timed("recommend, the better of both", lambda: recommend_for(scenario))
    print(f"recommend takes {both / own:.1f} times as long as limits")
