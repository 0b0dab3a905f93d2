"""The README's picture: Fig. 1 of a real run beside the arm that moves in it; `make front` writes `docs/front.svg`.

An SVG, as a README shows nothing else that moves: curves and poses are numbers in a text, the browser plays them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from passiflex.plotting.style import ROLES
from passiflex.robots.frames import world_frames
from passiflex.runs.run_arm import chain_of
from passiflex.simulation import Run
from passiflex.studies.paper import Case, run_case, shipped_scenario

Array = NDArray[np.float64]

FILE = Path(__file__).with_name("front.svg")
WIDTH, HEIGHT = 960, 410
START, END = 9.5, 26.0
"""What is shown of the run [s]: the step at 10 s, the push from 20 s to 21 s."""
STEP, PUSH = 10.0, (20.0, 21.0)
SPEED = 1.5
"""Seconds of the run in one of the reader's."""
CURVE, POSE = 0.0625, 0.15
"""Time between two points of a curve, and between two poses [s]; what lies between is a straight line."""

LEFT, RIGHT, TOP, BOTTOM, GAP = 66.0, 594.0, 72.0, 372.0, 12.0
"""Of the diagrams, and what is free between two of them [px]."""
PANELS = (("Z", 2, -1.0, 12.6), ("Y", 1, -1.8, 8.6), ("X", 0, -3.6, 2.8))
"""Axis, its column, and what of it is shown [cm]; a centimetre is as high in all of them."""
LINES = {"baseline": "rigid baseline", "msd": "ideal", "proposed": "proposed law"}
"""The last one is on top."""

SCALE, ORIGIN = 385.0, (690.0, 338.0)
"""Of the arm: px per metre, and where its base stands."""
TURN, TILT = np.radians(28.0), np.radians(16.0)
"""How far the view is turned from along Y, and looks down."""
VIEW = np.array(
    [
        [np.cos(TURN), np.sin(TURN), 0.0],
        [np.sin(TURN) * np.sin(TILT), -np.cos(TURN) * np.sin(TILT), -np.cos(TILT)],
    ]
)
BENDS = [0, 2, 4, 6, 8]
"""Frames between which an iiwa's links are straight: base, shoulder, elbow, wrist, end effector."""
THICK, FOOT = (44, 38, 31, 22), 9.0
"""Of the links between them, and how high they stand [px]."""

COLOURS = {
    "fill": {
        "card": ("#ffffff", "#14181f"),
        "name": ("#24292f", "#e6e9ee"),
        "text": ("#5f6873", "#9aa4b1"),
        "linkend": ("#d3d8df", "#5b6675"),
        "edgeend": ("#8a94a1", "#0c0f14"),
        "joint": ("#3d4b61", "#202733"),
        "floor": ("#eef1f4", "#1d232c"),
        "foot.edge": ("#b9c0ca", "#3d4653"),
        "tool": ROLES["proposed"][:2],
        "ghosttip": ROLES["baseline"][:2],
        "force": ROLES["force"][:2],
    },
    "stroke": {
        "card": ("#d9dee5", "#2c333d"),
        "grid": ("#e7eaee", "#262d37"),
        "now": ("#5f6873", "#9aa4b1"),
        "link": ("#d3d8df", "#5b6675"),
        "edge": ("#8a94a1", "#0c0f14"),
        "goal": ("#24292f", "#e6e9ee"),
        "ghost": ROLES["baseline"][:2],
        "push": ROLES["force"][:2],
        **{name: ROLES[name][:2] for name in LINES},
    },
}
"""What each class is painted in, on white and on a dark ground."""
LOOP = f'dur="{(END - START) / SPEED:g}s" repeatCount="indefinite"'
"""How an animation goes on: through what is shown, and again."""
STYLE = """
text{font:13px system-ui,-apple-system,"Segoe UI",sans-serif}.name{font-weight:600}
.end{text-anchor:end}.middle{text-anchor:middle}.faint{opacity:.28}.band{opacity:.22}
path{fill:none;stroke-linejoin:round}.link,.edge{stroke-linecap:round}.stand{stroke-linecap:butt}
.goal{stroke-width:1.6}.push{stroke-width:4}.ghost{stroke-width:2.5;stroke-dasharray:1 5;stroke-linecap:round}
.still{display:none}@media(prefers-reduced-motion:reduce){.still{display:inline}.moving{display:none}.faint{opacity:1}}
"""


def picture() -> str:
    """Return the picture, from a run of the package's Fig. 1."""
    case = run_case(shipped_scenario("fig1"), compared=True)
    label = "Left, the end effector's displacement over time; right, the arm, moving as it did in that run."
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">',
            "<title>A step of 10 cm, then a push: the proposed law, a baseline and the ideal</title>",
            f"<desc>{label} Drawn by docs/front_picture.py from a simulation; `make front` draws it anew.</desc>",
            f"<style>{STYLE}{''.join(_style())}</style>",
            f'<rect class="card" x=".5" y=".5" width="{WIDTH - 1}" height="{HEIGHT - 1}" rx="10"/>',
            *_diagrams(case),
            *_arms(case),
            "</svg>\n",
        ]
    )


def _style() -> Iterator[str]:
    """Yield the rules that colour and dash the lines, and those of the dark."""
    for name in LINES:
        dash = " ".join(f"{length:g}" for length in ROLES[name].dash) or "none"
        yield f".{name}{{stroke-width:{1.3 * ROLES[name].width:.2f};stroke-dasharray:{dash}}}\n"
    for ground, (begin, end) in enumerate((("", ""), ("@media(prefers-color-scheme:dark){\n", "}\n"))):
        yield begin
        for paint, classes in COLOURS.items():
            rules = (f".{name}{{{paint}:{pair[ground]}}}" for name, pair in classes.items())
            yield "".join(rules).replace(".text{", "text{") + "\n"
        yield end


def _diagrams(case: Case) -> Iterator[str]:
    """Yield Fig. 1: three axes above each other, what was played in full colour and the rest faint."""
    time = np.arange(START, END + CURVE / 2, CURVE)
    moved = {name: _displacement(case, name, time) for name in LINES}
    high = (BOTTOM - TOP - GAP * (len(PANELS) - 1)) / sum(top - low for _, _, low, top in PANELS)  # px per cm
    at, paths = TOP, []
    for name, column, low, top in PANELS:
        zero, below = at + top * high, at + (top - low) * high
        for level in range(int(np.ceil(low / 5)) * 5, int(top) + 1, 5):
            y = zero - level * high
            yield f'<path class="grid" d="M{LEFT:g} {y:.1f}H{RIGHT:g}"/>'
            yield f'<text class="end" x="{LEFT - 8:g}" y="{y + 4.5:.1f}">{level}</text>'
        yield f'<text class="name" x="22" y="{(at + below) / 2 + 4.5:.1f}">{name}</text>'
        band = f"M{_x(PUSH[0]):.1f} {at:.1f}H{_x(PUSH[1]):.1f}V{below:.1f}H{_x(PUSH[0]):.1f}"
        yield f'<path class="force band" d="{band}"/>'
        for line in LINES:
            curve = _curve(_x(time), zero - 100 * high * moved[line][:, column])
            paths.append(f'<path class="{line}" d="{curve}"/>')
        at = below + GAP
    for second in range(10, int(END) + 1, 5):
        yield f'<text class="middle" x="{_x(second):.1f}" y="{BOTTOM + 20:g}">{second}{" s" * (second == 10)}</text>'
    yield f'<text class="end" x="{LEFT - 8:g}" y="{TOP - 6:g}">cm</text>'
    yield f'<text x="{_x(STEP) - 8:.1f}" y="{TOP - 6:g}">step of 10 cm in Z</text>'
    yield f'<text class="middle" x="{_x(sum(PUSH) / 2):.1f}" y="{TOP - 6:g}">4 N in Y</text>'
    yield from _legend()
    yield f'<clipPath id="past"><rect width="{RIGHT:g}" height="{HEIGHT}">'
    yield f'<animate attributeName="width" from="{LEFT:g}" to="{RIGHT:g}" {LOOP}/></rect></clipPath>'
    yield '<g class="faint"><g id="curves">'
    yield from paths
    yield '</g></g><use href="#curves" clip-path="url(#past)"/>'
    yield f'<path class="now moving" d="M0 {TOP:g}V{BOTTOM:g}">{_slide([(LEFT, 0.0), (RIGHT, 0.0)])}</path>'


def _displacement(case: Case, name: str, time: Array) -> Array:
    """Return how far the end effector is from where it started (N, 3) m."""
    if name in case.msd:
        known, moved = case.msd[name].time, case.msd[name].displacement
    else:
        known, moved = case.runs[name].time, case.runs[name]["position"] - case.runs[name]["position"][0]
    return np.column_stack([np.interp(time, known, column) for column in moved.T])


def _legend() -> Iterator[str]:
    """Yield what the lines are, above the diagrams."""
    x = LEFT
    for name in ("proposed", "baseline", "msd"):
        yield f'<path class="{name}" d="M{x:g} 28h34"/><text class="name" x="{x + 42:g}" y="32.5">{LINES[name]}</text>'
        x += 70 + 7.5 * len(LINES[name])


def _arms(case: Case) -> Iterator[str]:
    """Yield the arm under the proposed law, under the baseline as a dotted line, the reference, and the push."""
    time = np.arange(START, END + POSE / 2, POSE)
    run = case.runs["proposed"]
    arm, ghost = _pose(run, time), _pose(case.runs["baseline"], time)
    arm[:, 0, 1] -= FOOT
    before, after = _seen(run["desired_position"][np.searchsorted(run.time, (START, END))])
    yield from _markers()
    yield from _ground()
    for kind, rows in (("moving", slice(None)), ("still", slice(-1, None))):
        yield f'<g class="{kind}"><defs>'
        for i in range(len(THICK)):
            yield f'<path id="{kind}{i}" {_along(arm[rows, i : i + 2])}</path>'
        yield "</defs>"
        yield from _links(kind, "edge", 3)
        yield from _links(kind, "link", 0)
        yield f'<path class="ghost" marker-end="url(#ghosttip)" {_along(ghost[rows, 1:])}</path>'
        yield f'<path class="goal" d="M-14 0h28M0-14v28" transform="translate({after[0]:.1f},{after[1]:.1f})">'
        if kind == "moving":
            yield _slide([before, after], [0.0, (STEP - START) / (END - START)])
        yield "</path></g>"
    yield from _push(arm[-1, -1])
    middle = (RIGHT + WIDTH) / 2
    yield f'<text class="middle name" x="{middle:g}" y="{BOTTOM + 3:g}">KUKA iiwa 14</text>'
    yield f'<text class="middle" x="{middle:g}" y="{BOTTOM + 20:g}">dotted: under the baseline; cross: reference</text>'


def _links(kind: str, look: str, more: int) -> Iterator[str]:
    """Yield the links as thick lines, so much thicker than they are; the first one stands on its end."""
    for i, thick in enumerate(THICK):
        start, end = ("joint", "tool") if look == "link" else ("", "")
        ends = {"start": f"{look}foot", "end": f"{look}end"} if i == 0 else {"start": start}
        ends |= {"end": end} if i == len(THICK) - 1 else {}
        marks = "".join(f' marker-{where}="url(#{name})"' for where, name in ends.items() if name)
        stand = " stand" * (i == 0)
        yield f'<use href="#{kind}{i}" class="{look}{stand}" stroke-width="{thick + more}"{marks}/>'


def _markers() -> Iterator[str]:
    """Yield what sits on the ends of lines, and so moves with them; sizes are those of the line."""
    shapes = (
        *(("joint", "joint", 0.34, 0.34), ("tool", "tool", 0.36, 0.36), ("ghosttip", "ghosttip", 1.9, 1.9)),
        *((f"{look}end", f"{look}end", 0.5, 0.5) for look in ("edge", "link")),
        *((f"{look}foot", f"{look}end", 0.5, 0.5 * np.sin(TILT)) for look in ("edge", "link")),
    )
    for name, look, rx, ry in shapes:
        ellipse = f'<ellipse class="{look}" rx="{rx:g}" ry="{ry:.3f}"/>'
        yield f'<marker id="{name}" viewBox="-2 -2 4 4" markerWidth="4" markerHeight="4">{ellipse}</marker>'


def _ground() -> Iterator[str]:
    """Yield what the arm stands on."""
    (x, y), wide, flat = ORIGIN, THICK[0] / 2 + 10, np.sin(TILT)
    left, right, side = x - wide, x + wide, f"A{wide:g} {wide * flat:.1f} 0 0"
    yield f'<ellipse class="floor" cx="{x:g}" cy="{y:g}" rx="74" ry="{74 * flat:.0f}"/>'
    outline = (
        f"M{left:g} {y - FOOT:g}V{y:g}{side} 0 {right:g} {y:g}V{y - FOOT:g}{side} 0 {left:g} {y - FOOT:g}"
    )
    yield f'<path class="foot edge" d="{outline}{side} 0 {right:g} {y - FOOT:g}"/>'


def _push(tip: Array) -> Iterator[str]:
    """Yield an arrow that is there while the force acts; it ends at the end effector at rest."""
    along = VIEW @ [0.0, 1.0, 0.0]
    along /= np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    tail, head = tip - 78 * along, tip - 18 * along
    neck = head - 12 * along
    corners = _path([neck + 8 * across, head, neck - 8 * across])
    times = ";".join(f"{(t - START) / (END - START):.4f}" for t in PUSH)
    yield f'<g class="moving" opacity="0"><path class="push" d="{_path([tail, neck])}"/>'
    yield f'<path class="force" d="{corners}"/>'
    yield f'<animate attributeName="opacity" values="0;1;0" keyTimes="0;{times}" calcMode="discrete" {LOOP}/></g>'


def _pose(run: Run, time: Array) -> Array:
    """Return where the bends of a run's arm are seen at some instants (N, bends, 2) px."""
    chain = chain_of(run)
    assert chain is not None
    q = np.column_stack([np.interp(time, run.time, joint) for joint in run["q"].T])
    return _seen(world_frames(chain, q).position[:, BENDS])


def _x(time: Array | float) -> Array | float:
    """Return where an instant is [px]."""
    return LEFT + (time - START) / (END - START) * (RIGHT - LEFT)


def _seen(points: Array) -> Array:
    """Return points (..., 3) m of the world as they are seen (..., 2) px."""
    return np.array(ORIGIN) + SCALE * points @ VIEW.T


def _curve(x: Array, y: Array) -> str:
    """Return a line through points as steps from one to the next, which need fewer digits."""
    at = np.round(np.column_stack([x, y]), 1)
    steps = " ".join(f"{_short(dx)},{_short(dy)}" for dx, dy in np.diff(at, axis=0))
    return f"M{at[0, 0]:g},{at[0, 1]:g}l{steps}"


def _short(number: float) -> str:
    """Return a number to a tenth, without the zeros around its point."""
    text = f"{number + 0.0:.1f}".removesuffix(".0")
    return text.replace("0.", ".") if abs(number) < 1 else text


def _path(points: Iterable[Array]) -> str:
    """Return a line through points."""
    return "M" + "L".join(f"{u:.1f},{v:.1f}" for u, v in points)


def _along(lines: Array) -> str:
    """Return a path's shape, the last of some lines (N, points, 2), the end of its tag, and its way through them."""
    shapes = [_path(line) for line in lines]
    moves = f'<animate attributeName="d" values="{";".join(shapes)}" {LOOP}/>' if len(set(shapes)) > 1 else ""
    return f'd="{shapes[-1]}">{moves}'


def _slide(points: Iterable[Iterable[float]], shares: Iterable[float] = ()) -> str:
    """Return a motion through points; by jumps, if it is said at which shares of the time they begin."""
    values = ";".join("{:.1f},{:.1f}".format(*point) for point in points)
    jumps = ";".join(f"{share:.4g}" for share in shares)
    timing = f'keyTimes="{jumps}" calcMode="discrete" ' if jumps else ""
    return f'<animateTransform attributeName="transform" type="translate" values="{values}" {timing}{LOOP}/>'


if __name__ == "__main__":
    FILE.write_text(picture(), encoding="utf-8")
