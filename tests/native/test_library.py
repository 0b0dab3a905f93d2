"""The cache of compiled libraries: hits, races, damage, folders that cannot be written."""

import subprocess
import sys

import casadi as cs
import pytest

from passiflex.errors import CompilerError, PassiflexWarning, ValueRangeError
from passiflex.native import (
    Compiler,
    NativeFunction,
    compile_functions,
    find_compiler,
    library,
    load_external,
)


@pytest.fixture
def cache(monkeypatch, tmp_path):
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("PASSIFLEX_COMPILER", raising=False)
    library._warn_once.cache_clear()
    library._process_folder.cache_clear()
    return tmp_path / "cache"


@pytest.fixture
def compiled(cache):
    if find_compiler() is None:
        pytest.skip("no compiler")
    return cache


@pytest.fixture
def builds(monkeypatch):
    """Return a list that grows by one with every compilation."""
    calls, build = [], Compiler.build
    find_compiler()  # its probes are not counted

    def counted(self, source, target):
        calls.append(target)
        build(self, source, target)

    monkeypatch.setattr(Compiler, "build", counted)
    return calls


def square(name="square", factor=1.0):
    x = cs.SX.sym("x")
    return cs.Function(name, [x], [factor * x**2])


def test_the_second_call_compiles_nothing(compiled, builds):
    first = compile_functions([square()])
    assert compile_functions([square()]) == first
    assert len(builds) == 1
    assert list(compiled.iterdir()) == [first]


def test_whatever_shapes_the_code_is_in_the_key(compiled, builds, monkeypatch):
    paths = {
        compile_functions([square()]),
        compile_functions([square(factor=2.0)]),
        compile_functions([square()], driver="/* more */"),
    }
    monkeypatch.setattr(library, "_processor", lambda: "another processor")
    paths.add(compile_functions([square()]))
    monkeypatch.setattr(library, "find_compiler", lambda: Compiler(("cc",), "another compiler"))
    paths.add(compile_functions([square()]))
    assert len(paths) == len(builds) == 5


@pytest.mark.parametrize("content", [b"", b"not a library"])
def test_a_damaged_library_is_built_again(compiled, builds, content):
    source = library.generate([square()])
    path = compiled / (library._key(source, find_compiler()) + library.SUFFIX)
    compiled.mkdir()
    path.write_bytes(content)
    with pytest.warns(PassiflexWarning, match="damaged or not this user's: they are compiled again"):
        assert compile_functions([square()]) == path
    assert len(builds) == 1
    assert NativeFunction(square(), path)([3.0]) == 9.0
    assert list(compiled.iterdir()) == [path]


def test_a_library_that_never_loads_is_an_error(compiled, monkeypatch):
    monkeypatch.setattr(library, "_loads", lambda path: False)
    with pytest.raises(CompilerError, match=r"does not load; got .*setting PASSIFLEX_CACHE"):
        compile_functions([square()])


def test_two_processes_race_for_an_empty_cache(compiled):
    script = (
        "import casadi as cs, sys\n"
        "from passiflex.native import NativeFunction, compile_functions\n"
        "x = cs.SX.sym('x')\n"
        "f = cs.Function('square', [x], [x**2])\n"
        "sys.stdin.readline()\n"
        "print(NativeFunction(f, compile_functions([f]))([3.0])[0])\n"
    )
    racers = [
        subprocess.Popen(
            [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    for racer in racers:
        racer.stdin.write("go\n")
        racer.stdin.flush()
    assert [racer.communicate(timeout=60)[0].strip() for racer in racers] == ["9.0", "9.0"]
    assert [racer.returncode for racer in racers] == [0, 0]
    assert [p.suffix for p in compiled.iterdir()] == [library.SUFFIX]


def test_a_failed_build_leaves_nothing_behind(compiled):
    with pytest.raises(CompilerError):
        compile_functions([square()], driver="nonsense")
    assert list(compiled.iterdir()) == []


def test_an_unwritable_cache_warns_once_and_works(compiled, builds, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(PassiflexWarning, match="set PASSIFLEX_CACHE"):
        path = compile_functions([square()])
    assert compile_functions([square()]) == path  # a second warning would be an error here
    assert len(builds) == 1
    assert NativeFunction(square(), path)([3.0]) == 9.0


def test_without_a_compiler_one_warning_and_the_virtual_machine(cache, monkeypatch):
    monkeypatch.setenv("PASSIFLEX_COMPILER", "none")
    with pytest.warns(PassiflexWarning, match=r"install a C compiler .* passiflex\[zig\]"):
        assert compile_functions([square()]) is None
    assert compile_functions([square(factor=3.0)]) is None  # a second warning would be an error here
    assert NativeFunction(square(), None)([3.0]) == 9.0
    assert not cache.exists()


def test_names_are_plain_and_unique():
    bad = square("a" * 65)
    with pytest.raises(ValueRangeError, match="cannot be used in C; got 'aaa"):
        compile_functions([bad])
    with pytest.raises(ValueRangeError, match="given twice; got 'square'"):
        compile_functions([square(), square(factor=2.0)])
    for name in ("1st", "_x", "a-b", "a;b", "", "a\n", "é"):
        with pytest.raises(ValueRangeError, match="cannot be used in C"):
            library._check_names([name])


def test_external_functions_know_their_finite_differences(compiled):
    f = load_external("square", compile_functions([square()]))
    assert float(f.jacobian()(3.0, 0.0)) == pytest.approx(6.0, rel=1e-6)  # forward differences, about √ε


def test_a_missing_function_is_named(compiled):
    path = compile_functions([square()])
    with pytest.raises(CompilerError, match="'cube' cannot be loaded"):
        load_external("cube", path)
    with pytest.raises(CompilerError, match="'cube' cannot be loaded"):
        NativeFunction(square("cube"), path)
