"""The gains of a law in a scenario: matrices by blocks or as a whole, and joint quantities. All numbers in SI units."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, Field, model_validator

from passiflex.errors import SizeError, ValueRangeError
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]
Positive = Annotated[float, Quantity("1", above=0)]


def _definite(matrix: Matrix) -> Matrix:
    """Return a matrix that is symmetric and positive definite."""
    from passiflex.control.definite import require_positive_definite

    try:
        require_positive_definite("the matrix", np.array(matrix))
    except ValueRangeError as error:
        raise ValueError(str(error)) from None
    return matrix


def _free(matrix: Matrix) -> tuple[int, ...]:
    """Return the axes without any gain."""
    return tuple(i for i, row in enumerate(matrix) if not any(row))


def _held(matrix: Matrix) -> Matrix:
    """Return a matrix that is symmetric, and positive definite but for axes that are free."""
    held = np.delete(np.array(matrix), _free(matrix), axis=0)
    if len(held):
        _definite(tuple(map(tuple, np.delete(held, _free(matrix), axis=1).tolist())))
    if np.any(np.array(matrix)[:, list(_free(matrix))]):
        raise ValueError("the matrix is not symmetric: a free axis has zeros in its row and column")
    return matrix


def _block(value: float | Vector | Matrix) -> Matrix:
    """Return the 3×3 block of one number, 3 numbers or 3×3."""
    if np.ndim(value) == 2:
        return value  # type: ignore[return-value]
    return tuple(map(tuple, np.diag(np.broadcast_to(value, 3)).tolist()))


def _three(unit: str, **bound: float) -> Quantity:
    return Quantity(unit, ((), (3,), (3, 3)), **bound)  # type: ignore[arg-type]


def axis_names(axes: tuple[int, ...]) -> str:
    """Return the names of axes: translation x, rotation z."""
    return ", ".join(f"{('translation', 'rotation')[i // 3]} {'xyz'[i % 3]}" for i in axes) or "none"


_BLOCK = AfterValidator(_block), AfterValidator(_held)
_DEFINITE_BLOCK = AfterValidator(_block), AfterValidator(_definite)
_FULL = Annotated[Matrix, Quantity("", ((3, 3), (6, 6)))]


class AbstractShaped(Section):
    """A joint quantity that the inner loop makes: a multiple of the law's own, or numbers."""

    ways: ClassVar = (("ratio",), ("value",))
    ratio: Annotated[float | Vector, Quantity("1", ((), (None,)), above=0)] | None = Field(
        default=None, description="multiple of the law's own value, one number for all joints or one each"
    )
    value: float | Vector | None = Field(default=None, description="one number for all joints, or one each")

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, written: Any) -> Any:
        quantity = isinstance(written, dict) and written and set(written) <= {"value", "unit"}
        return written if isinstance(written, dict | cls) and not quantity else {"value": written}

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.ratio is None) == (self.value is None):
            raise ValueError("needs either a ratio or a quantity")
        return self

    def resolve(
        self, own: ArrayLike, name: str = "a joint quantity", robot: str = "given"
    ) -> NDArray[np.float64]:
        """Return the values (n,) for the law's `own` ones (n,).

        Raises
        ------
        SizeError
            If they do not fit the joints of the robot.
        """
        own = np.asarray(own, dtype=float)
        if (count := np.size(self.value or self.ratio or ())) not in (1, own.size):
            needs = f"one number or {own.size}"
            raise SizeError(f"{name} does not fit robot {robot!r}", got=f"{count} numbers", needs=needs)
        if self.value is None:
            return own * np.broadcast_to(np.asarray(self.ratio), own.shape)
        return np.array(np.broadcast_to(self.value, own.shape))


class ShapedStiffness(AbstractShaped):
    """K_e."""

    value: Annotated[float | Vector, Quantity("N m/rad", ((), (None,)), above=0)] | None = Field(
        default=None, description="one number for all joints, or one each, N m/rad"
    )


class ShapedInertia(AbstractShaped):
    """B_e."""

    value: Annotated[float | Vector, Quantity("kg m^2", ((), (None,)), above=0)] | None = Field(
        default=None, description="one number for all joints, or one each, kg m^2"
    )


class AbstractGains(Section):
    """A symmetric positive definite matrix of the task, by its blocks or as a whole; zero in axes that are free."""

    alternative: ClassVar[str | None] = None
    ways: ClassVar = (("translation", "rotation"), ("matrix",), ("ratio", "damping_ratio"))
    translation: Matrix | None = Field(default=None, description="translational block")
    rotation: Matrix | None = Field(default=None, description="rotational block; with task pose only")
    matrix: Annotated[_FULL, AfterValidator(_held)] | None = Field(
        default=None, description="the whole matrix in SI units: 6×6, or 3×3 for task position"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        ways = [w for w in ("translation", "matrix", self.alternative) if w]
        given = [w for w in ways if getattr(self, w) is not None]
        if len(given) != 1:
            raise ValueError(
                f"needs exactly one of {', '.join(ways)}; got {' and '.join(given) or 'none of them'}"
            )
        if self.rotation is not None and given != ["translation"]:
            raise Mistakes((("rotation",), "goes with translation only; remove it"))
        if given != [self.alternative] and len(self.free) == len(self.full()):
            raise ValueError("is zero in all directions; needs more than 0 in those that are not free")
        return self

    @property
    def free(self) -> tuple[int, ...]:
        """Return the axes of the task that are zero; not for gains given by a ratio."""
        return _free(tuple(map(tuple, self.full().tolist())))

    def require(self, task: str) -> None:
        """Raise Mistakes unless the size is that of the task."""
        size = 3 if task == "position" else 6
        if self.matrix is not None and len(self.matrix) != size:
            got = len(self.matrix)
            raise Mistakes(
                (("matrix",), f"a {task} task needs {size}×{size} numbers in SI units; got {got}×{got}")
            )
        if task == "position" and self.rotation is not None:
            raise Mistakes((("rotation",), "a position task has no rotation; remove it, or take task: pose"))
        if task == "pose" and self.translation is not None and self.rotation is None:
            raise Mistakes((("rotation",), "missing; a pose task needs it, a position task does not"))

    def full(self) -> NDArray[np.float64]:
        """Return the matrix (6, 6), or (3, 3) for a position task; not for gains given by a ratio."""
        if self.matrix is not None:
            return np.array(self.matrix)
        if self.translation is None:
            raise ValueRangeError("gains given by a ratio have no matrix", needs="the inertia of a posture")
        if self.rotation is None:
            return np.array(self.translation)
        zero = np.zeros((3, 3))
        return np.block([[np.array(self.translation), zero], [zero, np.array(self.rotation)]])


class AbstractInAxes(AbstractGains):
    """Gains in axes of the world or of a tool."""

    axes: Literal["world", "tool"] = Field(
        default="world",
        description="world: those said here; tool: all in the axes of the reference, that turn with it, with control "
        "only",
    )

    @property
    def in_tool(self) -> bool:
        """Return whether they are in the axes of the reference throughout."""
        return self.axes == "tool"

    @model_validator(mode="after")
    def _no_free_place(self) -> Self:
        if self.in_tool and self.alternative is not None and getattr(self, self.alternative) is not None:
            raise Mistakes((("axes",), f"a {self.alternative} has no axes; remove it, or give the numbers"))
        if self.in_tool and any(i < 3 for i in self.free):
            raise Mistakes(
                (("axes",), "a free translation is one of the world; remove it, or hold all three")
            )
        return self


class Stiffness(AbstractInAxes):
    """K_x."""

    translation: Annotated[Matrix, _three("N/m", least=0), *_BLOCK] | None = Field(
        default=None, description="one number, 3 numbers or 3×3, N/m, world axes; 0 for a free axis"
    )
    rotation: Annotated[Matrix, _three("N m/rad", least=0), *_BLOCK] | None = Field(
        default=None,
        description="one number, 3 numbers or 3×3, N m/rad, axes of the reference; 0 for a free axis",
    )


class Damping(AbstractInAxes):
    """D_x."""

    alternative: ClassVar[str | None] = "ratio"
    translation: Annotated[Matrix, _three("N s/m", least=0), *_BLOCK] | None = Field(
        default=None, description="one number, 3 numbers or 3×3, N s/m, world axes; 0 for a free axis"
    )
    rotation: Annotated[Matrix, _three("N m s/rad", least=0), *_BLOCK] | None = Field(
        default=None,
        description="one number, 3 numbers or 3×3, N m s/rad; world axes, with a free rotation those of the "
        "reference; 0 for a free axis",
    )
    ratio: Positive | None = Field(
        default=None,
        description="damping ratio of every mode at the start posture, with the inertia of links and motors as "
        "the law shapes them",
    )


class TargetInertia(AbstractGains):
    """M_x."""

    alternative: ClassVar[str | None] = "damping_ratio"
    matrix: Annotated[_FULL, AfterValidator(_definite)] | None = Field(
        default=None, description="the whole matrix in SI units: 6×6, or 3×3 for task position"
    )
    translation: Annotated[Matrix, _three("kg", above=0), *_DEFINITE_BLOCK] | None = Field(
        default=None, description="one number, 3 numbers or 3×3, kg"
    )
    rotation: Annotated[Matrix, _three("kg m^2", above=0), *_DEFINITE_BLOCK] | None = Field(
        default=None, description="one number, 3 numbers or 3×3, kg m^2; with task pose only"
    )
    damping_ratio: Positive | None = Field(
        default=None, description="the inertia that gives every mode this damping ratio"
    )


def free_mistakes(gains: Stiffness | Damping, free: tuple[int, ...]) -> str:
    """Return what is wrong with gains whose free axes need to be these; nothing if they are, or go by a ratio."""
    if getattr(gains, "ratio", None) is not None or gains.free == free:
        return ""
    needs = f"zero in {axis_names(free)}" if free else "more than 0 in every direction"
    what = f"needs {needs}, as the law's stiffness; got zero in {axis_names(gains.free)}"
    return f"{what}; a free direction has neither stiffness nor damping: null_space_damping damps it"
