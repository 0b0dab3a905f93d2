"""CasADi functions of one column, run in lanes on as many arguments as one likes."""

from __future__ import annotations

import ctypes

import casadi as cs
import numpy as np

from passiflex.native import compile_source
from passiflex.native.lane_data import aligned
from passiflex.native.lane_source import lane_source

OVER = """
LANE_EXPORT void {0}_over(long long n, const lanes* x, lanes* y)
{{
    for (long long k = 0; k < n; k++) {0}_in_lanes(x + k * {1}, y + k * {2});
}}
"""


class LaneCalls:
    """The functions (x) → y in one library; `calls(name, x)` returns rows y for rows x."""

    def __init__(self, functions: list[cs.Function], width: int | None = None):
        self.functions = {f.name(): f for f in functions}
        drivers = [OVER.format(f.name(), f.size1_in(0), f.size1_out(0)) for f in functions]
        sizes = "LANE_EXPORT int lane_width(void) { return LANES; }"
        source = "\n".join([lane_source(functions, width), sizes, *drivers])
        self.library = ctypes.CDLL(str(compile_source(source)))
        self.width: int = self.library.lane_width()

    def __call__(self, name: str, x: np.ndarray) -> np.ndarray:
        """Return f of each row; neighbours in the rows are neighbours in the lanes."""
        f = self.functions[name]
        groups = -(-len(x) // self.width)
        padded = np.concatenate([x, np.tile(x[-1:], (groups * self.width - len(x), 1))])
        inputs = aligned("room", None, (groups, x.shape[1], self.width))
        inputs[...] = padded.reshape(groups, self.width, -1).transpose(0, 2, 1)
        outputs = aligned("room", None, (groups, f.size1_out(0), self.width))
        routine = self.library[f"{name}_over"]
        routine.argtypes, routine.restype = [ctypes.c_longlong, ctypes.c_void_p, ctypes.c_void_p], None
        routine(groups, inputs.ctypes.data, outputs.ctypes.data)
        return outputs.transpose(0, 2, 1).reshape(groups * self.width, -1)[: len(x)]

    def casadi(self, name: str, x: np.ndarray) -> np.ndarray:
        """Return the same by CasADi's virtual machine."""
        f = self.functions[name]
        return f.map(len(x))(x.T).full().T


def units(ours: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Return how far `ours` is from `exact`, in units in its last place; 0 for equal ones that are no numbers."""
    with np.errstate(invalid="ignore", over="ignore"):
        same = (ours == exact) | (np.isnan(ours) & np.isnan(exact))
        apart = np.abs(ours - exact) / np.spacing(np.abs(exact.astype(np.float64)))
    return np.where(same, 0.0, np.where(np.isnan(apart), np.inf, apart)).astype(float)
