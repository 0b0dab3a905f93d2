"""An element that another simulator moves: to the loop, what is felt of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, final

import casadi as cs
from numpy.typing import ArrayLike

from passiflex.elements import AbstractElement, Effect, Mobility, Touch, nothing
from passiflex.layout import Field, Layout, Signal
from passiflex.problems.problem import SampledProblem

FELT = ("wrench", "lost", "stored")


@final
@dataclass(frozen=True)
class Felt(AbstractElement):
    """Acts as its state says, which whoever moves the plant writes at every step; its numbers are the element's."""

    meaning: ClassVar[str] = "lost where the end effector touches it, by the other simulator"
    stores: ClassVar[bool] = True
    acts: bool = True
    element: AbstractElement = dataclasses.field(kw_only=True)

    @property
    def name(self) -> str:
        """Return the element's own name."""
        return self.element.name

    @property
    def structure(self) -> Hashable:
        """Return what its code depends on."""
        return type(self), self.element.structure

    def parameters(self, n: int) -> Layout:
        """Return the element's own numbers."""
        return self.element.parameters(n)

    def numbers(self, n: int) -> Mapping[str, ArrayLike]:
        """Return their values."""
        return self.element.numbers(n)

    def inputs(self) -> Layout:
        """Return the element's own inputs."""
        return self.element.inputs()

    def state(self, n: int) -> Layout:
        """Return what is felt of it."""
        return Layout(
            (
                Field(
                    f"{self.name}_wrench",
                    (6,),
                    "N, N m",
                    "on the end effector, world axes",
                    axes=("component",),
                ),
                Field(f"{self.name}_lost", (), "W", "lost in it", kept=False),
                Field(f"{self.name}_stored", (), "J", "stored in it", kept=False),
            )
        )

    def rate(self, free: Mobility) -> float:
        """Return how fast robot and element swing on each other."""
        return self.element.rate(free)

    def seen(self, at: Touch, s: Any, m: Any) -> tuple[Signal, ...]:
        """Return what is to be seen of the element, with the force that is felt."""
        force = getattr(at.own, f"{self.name}_wrench")[:3]
        nothing_bent = {f.name: cs.SX.zeros(*f.shape) for f in self.element.state(at.x.q.numel())}
        seen = self.element.seen(at._replace(own=SimpleNamespace(**nothing_bent)), s, m)
        return tuple(v._replace(value=force) if v.field.name == f"{self.name}_force" else v for v in seen)

    def act(self, at: Touch, s: Any, m: Any) -> Effect:
        """Return what its state says."""
        wrench, lost, stored = (getattr(at.own, f"{self.name}_{part}") for part in FELT)
        force, moment = (at.rotation.T @ half for half in (wrench[:3], wrench[3:]))
        none = nothing(at.x.q.numel())
        rate = cs.SX.zeros(self.state(none.motor.numel()).size)
        return none._replace(force=force, moment=moment, lost=lost, stored=stored, rate=rate)


def felt(problem: SampledProblem, made: Mapping[str, object]) -> SampledProblem:
    """Return the problem with the elements of these names felt only; its numbers are the same."""
    elements = tuple(Felt(element=e) if e.name in made else e for e in problem.elements)
    return dataclasses.replace(problem, elements=elements)
