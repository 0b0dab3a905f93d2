"""Finding a compiler: the order, the environment variables, the messages."""

import importlib.util
import sys

import casadi as cs
import numpy as np
import pytest

from passiflex.errors import CompilerError, NameUnknownError
from passiflex.native import NativeFunction, compile_functions, compiler, find_compiler


@pytest.fixture(autouse=True)
def _clean(monkeypatch, tmp_path):
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("PASSIFLEX_COMPILER", raising=False)
    monkeypatch.delenv("CC", raising=False)


@pytest.mark.parametrize("cc", ["/nowhere/cc --fast", "false", "true", "'unbalanced"])
def test_nonsense_in_cc_is_named(monkeypatch, cc):
    monkeypatch.setenv("CC", cc)
    with pytest.raises(CompilerError, match=r"the compiler in \$CC does not work; got CC=.*unsetting CC"):
        find_compiler()


def test_cc_may_carry_arguments(monkeypatch):
    found = find_compiler()
    if found is None or "zig" in found.identity:
        pytest.skip("no system compiler")
    monkeypatch.setenv("CC", f"{found.argv[0]} -DEXTRA=1")
    assert find_compiler().argv == (found.argv[0], "-DEXTRA=1")
    assert find_compiler().identity != found.identity


def test_flags_that_the_compiler_refuses_are_left_out(monkeypatch, tmp_path):
    found = find_compiler()
    if found is None or "zig" in found.identity:
        pytest.skip("no system compiler")
    wrapper = tmp_path / "picky"
    wrapper.write_text(f'#!/bin/sh\ncase "$*" in *march*) exit 1;; esac\nexec {found.argv[0]} "$@"\n')
    wrapper.chmod(0o755)
    monkeypatch.setenv("CC", str(wrapper))
    assert find_compiler().flags[1:] == compiler.FLAGS


@pytest.mark.parametrize(("level", "flag"), [("", "-O2"), ("1", "-O1"), ("3", "-O3")])
def test_how_hard_it_tries_is_asked_for(monkeypatch, level, flag):
    if find_compiler() is None:
        pytest.skip("no compiler")
    monkeypatch.setenv("PASSIFLEX_OPTIMISE", level)
    assert find_compiler().flags[0] == flag


def test_no_compiler_tries_that_hard(monkeypatch):
    monkeypatch.setenv("PASSIFLEX_OPTIMISE", "fast")
    with pytest.raises(NameUnknownError, match="PASSIFLEX_OPTIMISE; got 'fast'"):
        find_compiler()


def test_none_finds_none(monkeypatch):
    monkeypatch.setenv("PASSIFLEX_COMPILER", "none")
    monkeypatch.setenv("CC", "/nowhere/cc")
    assert find_compiler() is None


def test_an_unknown_choice_lists_the_choices(monkeypatch):
    monkeypatch.setenv("PASSIFLEX_COMPILER", "zigg")
    with pytest.raises(NameUnknownError, match="try 'zig'"):
        find_compiler()


def test_an_empty_path_leaves_zig_or_none(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    found = find_compiler()
    assert (found is None) == (importlib.util.find_spec("ziglang") is None)


def test_zig_asked_for_and_absent(monkeypatch):
    monkeypatch.setenv("PASSIFLEX_COMPILER", "zig")
    monkeypatch.setattr(compiler, "_zig", lambda level: None)
    compiler._find.cache_clear()
    with pytest.raises(CompilerError, match=r"passiflex\[zig\]"):
        find_compiler()


def test_zig_compiles(monkeypatch):
    pytest.importorskip("ziglang")
    monkeypatch.setenv("PASSIFLEX_COMPILER", "zig")
    assert find_compiler().argv[:4] == (sys.executable, "-m", "ziglang", "cc")
    x = cs.SX.sym("x", 2)
    f = cs.Function("turn", [x], [cs.vertcat(cs.sin(x[0]), x[0] * x[1] ** 2)])
    native = NativeFunction(f, compile_functions([f]))
    np.testing.assert_allclose(native([0.5, 3.0]), [np.sin(0.5), 4.5], rtol=1e-14)


def test_the_compilers_own_words_are_in_the_error(monkeypatch):
    if find_compiler() is None:
        pytest.skip("no compiler")
    x = cs.SX.sym("x")
    with pytest.raises(
        CompilerError, match=r"(?s)stopped with exit status 1 .*nonsense_here.*PASSIFLEX_COMPILER"
    ):
        compile_functions([cs.Function("f", [x], [x])], driver="int broken = nonsense_here;\n")
