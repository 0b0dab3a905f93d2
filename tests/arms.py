"""Random arms for Hypothesis: valid chains, and URDF text with everything that the reader has to lump."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from passiflex.robots.chain import Body, Joint, SerialChain


def _body(rng: np.random.Generator) -> Body:
    """Return a box of random edges, turned at random: its moments obey the triangle inequality."""
    mass, (a, b, c) = rng.uniform(0.3, 6.0), rng.uniform(0.05, 0.4, 3) ** 2
    R = Rotation.random(random_state=rng).as_matrix()
    tensor = R @ np.diag([b + c, a + c, a + b]) @ R.T * mass / 12
    return Body(float(mass), rng.uniform(-0.15, 0.15, 3), tensor[np.triu_indices(3)])


def _joint(rng: np.random.Generator, name: str, prismatic: bool = True) -> Joint:
    axis = rng.normal(size=3) if rng.random() < 0.5 else rng.choice([-1.0, 1.0]) * np.eye(3)[rng.integers(3)]
    quarter_turns = rng.integers(-2, 3, 3) * np.pi / 2
    rpy = quarter_turns if rng.random() < 0.5 else rng.uniform(-np.pi, np.pi, 3)
    kind = "prismatic" if rng.random() < 0.25 and prismatic else "revolute"
    limit = np.inf if rng.random() < 0.2 else rng.uniform(1, 3)
    return Joint(
        name, kind, rng.uniform(-0.4, 0.4, 3), rpy, axis / np.linalg.norm(axis), -limit, limit, 2.0, 80.0
    )


def _chain(n: int, seed: int, prismatic: bool) -> SerialChain:
    rng = np.random.default_rng(seed)
    joints = tuple(_joint(rng, f"j{i}", prismatic) for i in range(n))
    bodies = tuple(_body(rng) for _ in range(n))
    tip_rotation = Rotation.random(random_state=rng).as_matrix()
    return SerialChain("random", joints, bodies, rng.uniform(-0.2, 0.2, 3), tip_rotation)


def serial_chains(
    min_joints: int = 1, max_joints: int = 8, *, prismatic: bool = True
) -> st.SearchStrategy[SerialChain]:
    """Return a strategy for valid chains with physically consistent bodies."""
    return st.builds(
        _chain, st.integers(min_joints, max_joints), st.integers(0, 2**32 - 1), st.just(prismatic)
    )


def _link(name: str, body: Body | None, rpy: np.ndarray | None = None) -> str:
    if body is None:
        return f'<link name="{name}"/>'
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    tensor = " ".join(f'{k}="{float(v)!r}"' for k, v in zip(keys, body.inertia, strict=True))
    origin = f'<origin xyz="{_words(body.com)}" rpy="{_words(rpy if rpy is not None else np.zeros(3))}"/>'
    inertial = f'{origin}<mass value="{body.mass!r}"/><inertia {tensor}/>'
    return f'<link name="{name}"><inertial>{inertial}</inertial></link>'


def _edge(joint: Joint, parent: str, child: str, kind: str | None = None) -> str:
    return (
        f'<joint name="{joint.name}" type="{kind or joint.kind}">'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_words(joint.xyz)}" rpy="{_words(joint.rpy)}"/><axis xyz="{_words(joint.axis)}"/>'
        '<limit lower="-2" upper="2" velocity="2" effort="50"/></joint>'
    )


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(v)) for v in values)


def _document(n: int, seed: int) -> str:
    rng = np.random.default_rng(seed)
    out, last = [_link("ground", _body(rng))], "ground"

    def add(name: str, parent: str, body: Body | None, kind: str | None = None) -> str:
        out.append(_link(name, body, rng.uniform(-np.pi, np.pi, 3)))
        out.append(_edge(_joint(rng, f"to_{name}"), parent, name, kind))
        return name

    for i in range(n):
        for k in range(rng.integers(3)):
            last = add(f"spacer_{i}_{k}", last, _body(rng) if rng.random() < 0.5 else None, "fixed")
        last = add(f"arm_{i}", last, _body(rng))
        if rng.random() < 0.5:
            camera = add(f"camera_{i}", last, _body(rng), "fixed")
            add(f"lens_{i}", camera, _body(rng), "fixed")
    add("tool", last, _body(rng), "fixed")
    add("side_branch", last, _body(rng), "fixed")
    order = rng.permutation(len(out))
    return '<robot name="random">\n' + "\n".join(out[i] for i in order) + "\n</robot>\n"


def random_urdf(min_joints: int = 1, max_joints: int = 8) -> st.SearchStrategy[str]:
    """Return a strategy for URDF text with fixed links in between, massive side branches and a `tool`."""
    return st.builds(_document, st.integers(min_joints, max_joints), st.integers(0, 2**32 - 1))
