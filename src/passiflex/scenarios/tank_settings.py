"""The settings of the energy tank in a scenario file, in SI units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from passiflex.scenarios.tank_uses import CONTINUOUS, SAMPLED
from passiflex.texts.quantity import Quantity
from passiflex.texts.section import Mistakes, Section

Energy = Annotated[float, Quantity("J", least=0)]

if TYPE_CHECKING:  # who reads a scenario needs no CasADi
    from passiflex.sampled.tank import AbstractTank

    Kind = str
else:
    Kind = Literal[tuple(SAMPLED)]

PAPER_DEFAULTS: dict[str, Any] = {"accounting": "paper"}
PORT_DEFAULTS: dict[str, Any] = {"accounting": "signed", "floor": 0.1, "low": 0.2}
"""What goes with a kind of tank. The port tank measures: its floor stands above the error of that."""


class TankSettings(Section):
    """The energy tank that pays for the motion of the reference."""

    initial: Energy = Field(default=2.0, description="energy at the start, J; at most the cap")
    fill: Annotated[float, Quantity("1", least=0, most=1)] = Field(
        default=1.0,
        description="share α of the dissipated power that fills a paper or variable_stiffness tank, 0 to 1",
    )
    floor: Energy = Field(
        default=0.01, description="level that the reference never draws below, J; 0.1 J for the port tank"
    )
    low: Energy = Field(
        default=0.05,
        description="level below which the reference slows down and the valve closes, J; 0.2 J for the port tank",
    )
    cap: Annotated[float, Quantity("J", least=0, finite=False)] = Field(
        default=float("inf"), description="level above which energy is spilled, J; inf for none"
    )
    band: Annotated[float, Quantity("J", above=0)] = Field(
        default=0.05,
        description="width below the cap over which the inflow fades out, J; in continuous time only",
    )
    accounting: Literal["paper", "signed"] | None = Field(
        default=None,
        description="a moving reference draws |P_X| (paper; default) or P_X (signed; default of the port tank)",
    )
    kind: Kind | None = Field(
        default=None,
        description="whose books: paper (default without control), port (default with control), or those "
        "after Hannaford and Ryu and after Ferraguti",
    )
    power: Annotated[float, Quantity("W", above=0, finite=False)] = Field(
        default=float("inf"),
        description="largest power that the reference is granted, W; kinds port and paper, with control",
    )
    trip: Energy | None = Field(
        default=None, description="below it the law falls back, J; half of the floor if left out; kind port"
    )
    braking: Annotated[float, Quantity("N m s/rad", least=0)] = Field(
        default=50.0, description="most damping that kind time_domain adds to the motors, N m s/rad"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        found: list[tuple[tuple[str | int, ...], str]] = []
        floor, low = self._likely("floor"), self._likely("low")
        if not self.initial > self.floor:
            what = f"a tank started empty never moves the reference; got {self.initial:g} J"
            found.append((("initial",), f"{what}; needs more than the {self._said('floor', self.floor)}"))
        if not low > self.floor:
            got = f"{low:g} J" if "low" in self.model_fields_set else f"the default of {low:g} J"
            found.append(
                (("low",), f"needs more than the {self._said('floor', self.floor)}; got {got}"),
            )
        if not self.cap > self.low:
            found.append((("cap",), f"needs more than the {self._said('low', self.low)}; got {self.cap:g} J"))
        elif not self.cap >= self.initial:
            needs = f"at least the {self._said('initial', self.initial)}"
            found.append((("cap",), f"needs {needs}: what is above it is spilled; got {self.cap:g} J"))
        if self.trip is not None and not self.trip < floor:
            found.append(
                (("trip",), f"needs less than the {self._said('floor', floor)}; got {self.trip:g} J")
            )
        if found:
            raise Mistakes(*found)
        return self

    def _likely(self, name: Literal["floor", "low"]) -> float:
        """Return a level as it will be: the port tank's own if it is left out, and the tank may still become one."""
        left_out = name not in self.model_fields_set and self.kind in (None, "port")
        return PORT_DEFAULTS[name] if left_out else getattr(self, name)

    def _said(self, name: str, value: float) -> str:
        """Return a level in words, which say when it is nobody's but the default."""
        return f"{name} of {value:g} J" + ("" if name in self.model_fields_set else " (the default)")

    def require_used(self, *, sampled: bool) -> None:
        """Raise Mistakes for settings, not at their defaults, that a tank of this kind does not go by."""
        known = (SAMPLED[self.kind or "port"] if sampled else CONTINUOUS).all
        kind = f"a tank of kind {self.kind}{'' if sampled else ' without `control`'}"
        found: list[tuple[tuple[str | int, ...], str]] = [
            ((name,), f"{kind} does not use it; {_users(name)} do; remove it")
            for name in self._unusual()
            if name not in known
        ]
        if not sampled and not self.cap - self.band > self.low:
            needs = f"more than low + band, {self.low + self.band:g} J"
            found.append((("cap",), f"needs {needs}; got {self.cap:g} J"))
        if found:
            raise Mistakes(*found)

    def require_gated(self) -> None:
        """Raise Mistakes for settings of a valve that gates nothing, where this kind has no other use for them."""
        gates = SAMPLED[self.kind].gates if self.kind else ()
        what = (
            f"a tank of kind {self.kind} uses it for `actions` and `feedforward` only, and there is neither"
        )
        found = [((name,), f"{what}; {_users(name)} use it always; remove it") for name in self._unusual()]
        if mistakes := [entry for entry in found if entry[0][0] in gates]:
            raise Mistakes(*mistakes)

    def _unusual(self) -> list[str]:
        """Return the entries that are not at the defaults of this kind, which is known."""
        bare = type(self)().completed("port" if self.kind == "port" else "paper")
        names = [n for n in type(self).model_fields if n not in ("kind", "initial")]
        return [n for n in names if getattr(self, n) != getattr(bare, n)]

    def require(self, gravity: str) -> None:
        """Raise Mistakes if the tank's books are wrong for this choice of gravity."""
        if self.kind == "time_domain" and gravity != "robot":
            what = (
                "takes the weight that is lifted for energy given away; take law.gravity: robot, or kind port"
            )
            raise Mistakes((("kind",), what))

    def completed(self, kind: Literal["paper", "port"]) -> Self:
        """Return the settings with `kind` and the accounting that goes with it, where they were left out.

        They still count as left out: with another kind they become its own.
        """
        given = self.model_dump(exclude_unset=True, exclude_none=True)
        defaults = PORT_DEFAULTS if given.get("kind", kind) == "port" else PAPER_DEFAULTS
        made = type(self).model_validate({"kind": kind} | defaults | given)
        return type(self).model_construct(set(given), **dict(made))

    def build(self) -> AbstractTank:
        """Return the tank of a sampled run."""
        from passiflex.sampled.tanks import TANKS

        return TANKS[self.kind or "port"]()

    @property
    def signed(self) -> bool:
        """Return whether what the reference takes out comes back to the tank."""
        return self.accounting == "signed"


def _users(setting: str) -> str:
    """Return the kinds of tanks that go by a setting, in words."""
    sampled = [kind for kind, uses in SAMPLED.items() if setting in uses.always]
    kinds = [f"{', '.join(sampled)} with `control`"] if sampled else []
    return " and ".join(kinds + ["paper without `control`"] * (setting in CONTINUOUS.always))
