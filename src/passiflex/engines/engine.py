"""Who moves the plant of a sampled run: the native loop, or another simulator, by name."""

from __future__ import annotations

import abc
from typing import ClassVar, final

import numpy as np
from numpy.typing import NDArray

from passiflex.engines.contact import Contact, contact_of
from passiflex.engines.felt import Felt, felt
from passiflex.errors import NameUnknownError, ValueRangeError
from passiflex.loops.compiled import CompiledSampledLoop
from passiflex.loops.moved import moved_loop
from passiflex.native import HeldLoop
from passiflex.problems.problem import Problem, SampledProblem
from passiflex.version import __version__

Array = NDArray[np.float64]


class AbstractEngine(abc.ABC):
    """Moves the plant of a sampled loop, one period at a time, with the same law, row, delays and witness.

    Attributes
    ----------
    name: By which it is asked for.
    """

    name: ClassVar[str]

    @property
    @abc.abstractmethod
    def version(self) -> str:
        """Return its name and version, as a run has them."""

    @abc.abstractmethod
    def require(self, problem: Problem) -> None:
        """Refuse a problem that it cannot run, before anything is compiled."""

    def prepared(self, problem: SampledProblem) -> SampledProblem:
        """Return the problem as the engine runs it: with the elements that it moves itself only felt."""
        return problem

    @abc.abstractmethod
    def held(
        self, problem: SampledProblem, compiled: CompiledSampledLoop, x: Array, longest: float
    ) -> HeldLoop:
        """Return the loop through time, from the plant's state x on, with steps no longer than `longest` [s]."""


@final
class NativeEngine(AbstractEngine):
    """The loop in native code, of one compiled library."""

    name = "passiflex"

    @property
    def version(self) -> str:
        """Return the package's own."""
        return f"passiflex {__version__}"

    def require(self, problem: Problem) -> None:
        """Run everything."""

    def held(
        self, problem: SampledProblem, compiled: CompiledSampledLoop, x: Array, longest: float
    ) -> HeldLoop:
        """Return what was compiled."""
        return compiled.held


@final
class MujocoEngine(AbstractEngine):
    """MuJoCo, on a model made of the robot's own numbers; the law is stepped from Python."""

    name = "mujoco"

    @property
    def version(self) -> str:
        """Return MuJoCo's."""
        from passiflex.engines.mujoco_model import mujoco_module

        return f"mujoco {mujoco_module().__version__}"

    def require(self, problem: Problem) -> None:
        """Refuse what is in continuous time, and surfaces that MuJoCo does not make.

        Raises
        ------
        MissingExtraError
            If MuJoCo is not there.
        ValueRangeError
            For such a problem.
        """
        from passiflex.engines.mujoco_model import mujoco_module

        mujoco_module()
        if not isinstance(problem, SampledProblem):
            raise ValueRangeError(
                "the engine mujoco runs sampled loops, as a robot does",
                got=f"{problem.name}, in continuous time",
                needs="`control: {rate: …}` in the scenario",
                try_="the engine passiflex",
            )
        contacts_of(problem)

    def prepared(self, problem: SampledProblem) -> SampledProblem:
        """Return the problem with what MuJoCo touches only felt."""
        made = contacts_of(problem)
        return felt(problem, made) if made else problem

    def held(
        self, problem: SampledProblem, compiled: CompiledSampledLoop, x: Array, longest: float
    ) -> HeldLoop:
        """Return the loop on a new model."""
        from passiflex.engines.mujoco_plant import MujocoPlant

        plant = MujocoPlant(problem, moved_loop(problem.loop), x, longest, contacts_of(problem))
        loop = compiled.loop
        return HeldLoop(loop.plant.rhs, loop.control, watch=loop.watch, mover=plant)


def contacts_of(problem: Problem) -> dict[str, Contact]:
    """Return what MuJoCo makes of the elements of a problem, by their names."""
    numbers = problem.parts.unpack("plant", problem.numbers)
    elements = ((e.name, e.element if isinstance(e, Felt) else e) for e in problem.elements if e.acts)
    made = ((name, contact_of(element, numbers)) for name, element in elements)
    return {name: contact for name, contact in made if contact is not None}


NATIVE = NativeEngine()
ENGINES: dict[str, AbstractEngine] = {e.name: e for e in (NATIVE, MujocoEngine())}
"""By name."""


def engine_called(name: str) -> AbstractEngine:
    """Return an engine.

    Raises
    ------
    NameUnknownError
        With the names that there are.
    """
    if name not in ENGINES:
        raise NameUnknownError("engine", name, ENGINES)
    return ENGINES[name]
