"""What one core can do, measured: multiply-adds, divisions, loads and stores of one vector of lanes, and its clock."""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable
from typing import NamedTuple

from passiflex.native import compile_source
from passiflex.native.library import c_source

TEXT = """
#if defined(__x86_64__)
#define IN_REGISTER "v"
#else
#define IN_REGISTER "w"
#endif
#define KEEP(v) __asm__ volatile("" : "+" IN_REGISTER(v))
static lanes in_cache[128] __attribute__((aligned(64)));

#define ALL(f) f(0) f(1) f(2) f(3) f(4) f(5) f(6) f(7) f(8) f(9) f(10) f(11)
#define CHAIN(i) lanes v##i = all_lanes(1.5);
#define USE(i) KEEP(v##i);
#define MULTIPLY_ADD(i) v##i = v##i * a + b; KEEP(v##i);
#define DIVISION(i) v##i = a / v##i; KEEP(v##i);
/* Twelve chains, each of which waits for itself only, fill two units of latency 4 and fit into 16 registers. */
LANE_EXPORT void multiply_adds(long long n)
{
    lanes a = all_lanes(0.999), b = all_lanes(1e-3);
    ALL(CHAIN) KEEP(a); KEEP(b);
    for (long long k = 0; k < n; k++) { ALL(MULTIPLY_ADD) }
    ALL(USE)
}
LANE_EXPORT int multiply_adds_each(void) { return 12; }
LANE_EXPORT void divisions(long long n)
{
    lanes a = all_lanes(1.7);
    ALL(CHAIN)
    for (long long k = 0; k < n; k++) { ALL(DIVISION) }
    ALL(USE)
}
LANE_EXPORT int divisions_each(void) { return 12; }
LANE_EXPORT void loads(long long n)
{
    for (long long k = 0; k < n; k++)
        _Pragma("GCC unroll 128") for (int i = 0; i < 128; i++)
        {
            lanes v = ((volatile lanes*)in_cache)[i];
            __asm__ volatile("" : : IN_REGISTER(v));
        }
}
LANE_EXPORT int loads_each(void) { return 128; }
LANE_EXPORT void stores(long long n)
{
    lanes v = all_lanes(1.0);
    KEEP(v);
    for (long long k = 0; k < n; k++)
        _Pragma("GCC unroll 128") for (int i = 0; i < 128; i++) ((volatile lanes*)in_cache)[i] = v;
}
LANE_EXPORT int stores_each(void) { return 128; }
/* A chain of integer multiplications: each takes 3 cycles on all processors of the last ten years. */
LANE_EXPORT void cycles(long long n)
{
    uint64_t v = 3;
    for (long long k = 0; k < n; k++)
        _Pragma("GCC unroll 16") for (int i = 0; i < 16; i++) { v = v * v; __asm__ volatile("" : "+r"(v)); }
}
LANE_EXPORT int cycles_each(void) { return 48; }
LANE_EXPORT int width(void) { return LANES; }
/* Instructions of 8 bytes that do nothing: how fast code comes, from where it fits. */
#if defined(__x86_64__)
#define FETCH(name, count) \
    LANE_EXPORT void name(long long n) \
    { for (long long k = 0; k < n; k++) __asm__ volatile(".rept " #count "\\n.byte 15,31,132,0,0,0,0,0\\n.endr"); } \
    LANE_EXPORT int name##_each(void) { return 8 * count; }
FETCH(code_16k, 2048)
FETCH(code_48k, 6144)
FETCH(code_256k, 32768)
#endif
"""
MEASURED = ("multiply_adds", "divisions", "loads", "stores", "cycles")
CODE = {16 << 10: "code_16k", 48 << 10: "code_48k", 256 << 10: "code_256k"}


class Rates(NamedTuple):
    """Instructions per second of one core, each on one vector of `lanes` doubles.

    `cycles` is its clock [Hz]; `code` by size of a straight chunk of code [byte] how fast it comes [byte/s],
    empty where that is not measured.
    """

    lanes: int
    multiply_adds: float
    divisions: float
    loads: float
    stores: float
    cycles: float
    code: dict[int, float]

    def fetched(self, size: int) -> float:
        """Return how fast code of this size comes [byte/s]: as the chunk that was measured nearest to it in size."""
        if not self.code:
            return float("inf")
        return self.code[min(self.code, key=lambda known: abs(math.log(known / size)))]


def core_rates(width: int | None = None, repeats: int = 5, seconds: float = 0.02) -> Rates:
    """Return the best rates of several tries; `width` lanes, by the processor if None."""
    chosen = "" if width is None else f"#define LANES {width}\n"
    library = ctypes.CDLL(str(compile_source(chosen + c_source("lanes.h") + TEXT)))
    best = {name: _rate(library, name, repeats, seconds) for name in MEASURED}
    known = hasattr(library, "code_16k")
    code = {size: _rate(library, name, repeats, seconds) for size, name in CODE.items()} if known else {}
    return Rates(library.width(), **best, code=code)


def _rate(library: ctypes.CDLL, name: str, repeats: int, seconds: float) -> float:
    routine, each = getattr(library, name), getattr(library, f"{name}_each")()
    routine.argtypes, routine.restype = [ctypes.c_longlong], None
    n = 10
    while cpu_seconds(routine, n) < seconds:
        n *= 2
    return n * each / min(cpu_seconds(routine, n) for _ in range(repeats))


def cpu_seconds(work: Callable[..., object], *args: object) -> float:
    """Return how long a core worked on a call [s]; waiting while others have the core is not counted."""
    start = time.process_time()
    work(*args)
    return time.process_time() - start
