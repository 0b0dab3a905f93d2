"""A port-Hamiltonian system (1) as a value, from which everything else is derived."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike


class Structure(NamedTuple):
    """How well a system keeps the structure of (1) at one point; zero, zero and ≥ 0 in exact arithmetic.

    Attributes
    ----------
    skew_defect: max |interconnection + interconnectionᵀ|.
    symmetry_defect: max |dissipation − dissipationᵀ|.
    least_dissipation: Smallest eigenvalue of the dissipation's symmetric part.
    balance_defect: Ḣ − (yᵀu − dissipated) [W].
    scale: Largest entry met, for judging the defects.
    """

    skew_defect: float
    symmetry_defect: float
    least_dissipation: float
    balance_defect: float
    scale: float

    def holds(self, tolerance: float = 1e-11) -> bool:
        """Return whether every defect is round-off, relative to the largest entry."""
        small = tolerance * max(self.scale, 1.0)
        defects = (self.skew_defect, self.symmetry_defect, abs(self.balance_defect), -self.least_dissipation)
        return all(d <= small for d in defects)


@dataclass(frozen=True, eq=False)
class PortHamiltonianSystem:
    """The system (1), with x the state, u the input and p the parameters.

        ẋ = [J(x) − R(x)] ∇H(x) + g(x) u,    y = gᵀ(x) ∇H(x)

    J = −Jᵀ is `interconnection`, R = Rᵀ ≥ 0 is `dissipation`, g is `input_map`. All are CasADi
    expressions; J, R and g may be modulated by the input. Vector field, output and powers are
    derived from H and the three matrices, and from nothing else. Powers are in W: `supplied_power`
    counts positive into the system, `dissipated_power` is ≥ 0.
    """

    state: cs.SX
    inputs: cs.SX
    parameters: cs.SX
    hamiltonian: cs.SX
    interconnection: cs.SX
    dissipation: cs.SX
    input_map: cs.SX

    @cached_property
    def gradient(self) -> cs.SX:
        """Return ∇H."""
        return cs.gradient(self.hamiltonian, self.state)

    @cached_property
    def vector_field(self) -> cs.SX:
        """Return ẋ of (1)."""
        return (self.interconnection - self.dissipation) @ self.gradient + self.input_map @ self.inputs

    @cached_property
    def output(self) -> cs.SX:
        """Return y = gᵀ ∇H."""
        return self.input_map.T @ self.gradient

    @cached_property
    def supplied_power(self) -> cs.SX:
        """Return yᵀu [W]."""
        return cs.dot(self.output, self.inputs)

    @cached_property
    def dissipated_power(self) -> cs.SX:
        """Return ∇Hᵀ R ∇H [W]."""
        return cs.dot(self.gradient, self.dissipation @ self.gradient)

    @cached_property
    def hamiltonian_rate(self) -> cs.SX:
        """Return Ḣ = ∇Hᵀẋ [W]."""
        return cs.dot(self.gradient, self.vector_field)

    def function(self, *expressions: cs.SX) -> cs.Function:
        """Return the given expressions as a CasADi function of (state, inputs, parameters)."""
        return cs.Function(
            "phs", [self.state, self.inputs, self.parameters], list(expressions), {"cse": True}
        )

    @cached_property
    def _matrices(self) -> cs.Function:
        return self.function(
            cs.densify(self.interconnection),
            cs.densify(self.dissipation),
            self.hamiltonian_rate - self.supplied_power + self.dissipated_power,
            cs.densify(self.vector_field),
            cs.densify(self.gradient),
        )

    def structure(self, state: ArrayLike, inputs: ArrayLike, parameters: ArrayLike) -> Structure:
        """Return how the structure of (1) holds at one point."""
        J, R, balance, field, gradient = (np.array(v) for v in self._matrices(state, inputs, parameters))
        powers = np.abs(field * gradient).sum()
        return Structure(
            skew_defect=float(np.abs(J + J.T).max()),
            symmetry_defect=float(np.abs(R - R.T).max()),
            least_dissipation=float(np.linalg.eigvalsh((R + R.T) / 2).min()),
            balance_defect=float(balance[0, 0]),
            scale=float(max(np.abs(J).max(), np.abs(R).max(), powers)),
        )
