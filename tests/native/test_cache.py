"""Only what this user made, and only as it was written, is loaded; and a killed process leaves nothing behind."""

import ctypes
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from passiflex.errors import CompilerError, PassiflexWarning
from passiflex.native import compile_source, compiler, find_compiler, library
from passiflex.native.builder import is_sealed, sealed
from passiflex.native.cache import DistrustError, make_folder, own_folder

SOURCE = '__attribute__((visibility("default"))) double answer(void) { return 42.0; }\n'
STRANGER = 54321


@pytest.fixture
def cache(monkeypatch, tmp_path):
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.delenv("PASSIFLEX_COMPILER", raising=False)
    if find_compiler() is None:
        pytest.skip("no compiler")
    library._warn_once.cache_clear()
    library._process_folder.cache_clear()
    yield tmp_path / "cache"
    library._process_folder.cache_clear()


def answer(path: Path) -> float:
    routine = ctypes.CDLL(str(path)).answer
    routine.restype = ctypes.c_double
    return routine()


def damage_it(path: Path, data: bytes) -> None:
    """Put other bytes there; those that this process has loaded stay as they are."""
    path.with_suffix(".new").write_bytes(data)
    path.with_suffix(".new").replace(path)


def is_whole(path: Path) -> bool:
    return is_sealed(path.read_bytes())


def evil(path: Path) -> None:
    """Put a library there that notes that it was loaded."""
    text = f"""#include <stdio.h>
__attribute__((constructor)) static void run(void) {{ fclose(fopen("{path}.ran", "w")); }}
double answer(void) {{ return 0.0; }}
"""
    find_compiler().build(text, path)


@pytest.mark.parametrize("size", [0, 1, 100, 1000, 4096, 8192, 12288, -1])
def test_a_library_that_is_cut_short_is_built_again(cache, size):
    path = compile_source(SOURCE)
    damage_it(path, path.read_bytes()[:size])
    with pytest.warns(PassiflexWarning, match="compiled again"):
        assert compile_source(SOURCE) == path
    assert answer(path) == 42.0
    assert is_whole(path)


def zero_the_tail(data: bytearray) -> None:
    data[len(data) // 2 :] = bytes(len(data) - len(data) // 2)


def flip_early(data: bytearray) -> None:
    data[200] ^= 1


def flip_late(data: bytearray) -> None:
    data[-2] ^= 1


def lengthen(data: bytearray) -> None:
    data += b"\0"


@pytest.mark.parametrize("damage", [zero_the_tail, flip_early, flip_late, lengthen])
def test_a_library_with_other_bytes_is_built_again(cache, damage):
    path = compile_source(SOURCE)
    data = bytearray(path.read_bytes())
    damage(data)
    damage_it(path, data)
    with pytest.warns(PassiflexWarning, match="compiled again"):
        assert compile_source(SOURCE) == path
    assert is_whole(path)
    assert compile_source(SOURCE) == path  # a second warning would be an error here


def test_a_seal_is_of_these_bytes_alone():
    assert is_sealed(sealed(b"content"))
    assert not any(map(is_sealed, (b"", b"content", sealed(b"content") + b" ", sealed(b"content")[1:])))
    assert not is_sealed(sealed(b"content").replace(b"cont", b"kont"))


@pytest.mark.parametrize("there", ["folder", "pipe", "link", "dangling link"])
def test_what_is_no_file_of_its_own_is_not_opened(cache, tmp_path, there):
    path = compile_source(SOURCE)
    path.rename(tmp_path / "elsewhere.so")
    {
        "folder": lambda: path.mkdir(),
        "pipe": lambda: os.mkfifo(path),
        "link": lambda: path.symlink_to(tmp_path / "elsewhere.so"),
        "dangling link": lambda: path.symlink_to("nowhere"),
    }[there]()
    with pytest.warns(PassiflexWarning) as warned:
        again = compile_source(SOURCE)
    assert compile_source(SOURCE) == again  # a second warning would be an error here
    assert len(warned) == 1
    assert (again == path) == (there != "folder")  # which is somebody's: what is in it is left alone
    assert again.parent == path.parent
    assert answer(again) == 42.0


def test_an_interpreter_that_cannot_be_started_is_one_line(cache, monkeypatch):
    for wrong in (str(cache.parent / "nowhere"), str(cache.parent), ""):
        monkeypatch.setattr("sys.executable", wrong)
        with pytest.raises(
            CompilerError, match=r"^Python cannot be started for the process that runs the compiler; got"
        ):
            compile_source(SOURCE)


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o775, 0o722])
def test_a_folder_that_others_may_write_is_not_used(cache, mode):
    path = compile_source(SOURCE)
    path.unlink()
    evil(path)
    cache.chmod(mode)
    with pytest.warns(PassiflexWarning, match=r"not safe \(others can write .*; got mode \d+\).*chmod go-w"):
        again = compile_source(SOURCE)
    assert again.parent != cache
    assert answer(again) == 42.0
    assert list(cache.iterdir()) == [path]


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o664])
def test_a_library_that_others_may_write_is_built_again(cache, mode):
    path = compile_source(SOURCE)
    path.chmod(mode)
    with pytest.warns(PassiflexWarning, match="compiled again"):
        assert compile_source(SOURCE) == path
    assert path.stat().st_mode & 0o022 == 0


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("given", ["folder", "library", "both", "hard link"])
@pytest.mark.parametrize("linked", [True, False])
def test_what_another_user_owns_is_not_loaded(cache, tmp_path, monkeypatch, given, linked):
    path = compile_source(SOURCE)
    path.unlink()
    evil(path)
    if given == "hard link":
        shutil.copy(path, tmp_path / "theirs.so")
        path.unlink()
        os.link(tmp_path / "theirs.so", path)
    if given != "folder":
        os.chown(path, STRANGER, STRANGER)
    if given in ("folder", "both"):
        os.chown(cache, STRANGER, STRANGER)
    if linked:
        (tmp_path / "link").symlink_to(cache)
        monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path / "link"))
    with pytest.warns(PassiflexWarning) as warned:
        assert answer(compile_source(SOURCE)) == 42.0
    assert len(warned) == 1
    assert not Path(f"{path}.ran").exists()


def test_a_folder_above_that_all_may_write_is_no_place_for_it(cache, tmp_path):
    above = tmp_path / "above"
    make_folder(above / "cache")
    above.chmod(0o777)
    with pytest.raises(DistrustError, match=rf"others can write {above}; got mode 777"):
        own_folder(above / "cache")
    above.chmod(0o1777)  # as /tmp
    assert own_folder(above / "cache") == above / "cache"


@pytest.mark.parametrize(("umask", "expected"), [(0, 0o755), (0o002, 0o755), (0o027, 0o750), (0o077, 0o700)])
def test_nobody_else_may_ever_write_whatever_the_umask(cache, monkeypatch, umask, expected):
    monkeypatch.setenv("PASSIFLEX_CACHE", str(cache / "deep" / "er"))
    before = os.umask(umask)
    try:
        path = compile_source(SOURCE)
    finally:
        os.umask(before)
    assert {p.stat().st_mode & 0o777 for p in (cache, cache / "deep", cache / "deep" / "er", path)} == {
        expected
    }


def test_a_user_without_a_home_gets_a_folder_for_the_process(cache, monkeypatch):
    def no_home(*_):
        raise RuntimeError("could not determine the home directory")

    monkeypatch.delenv("PASSIFLEX_CACHE")
    monkeypatch.setattr("platformdirs.user_cache_dir", no_home)
    with pytest.warns(PassiflexWarning, match=r"no cache folder \(could not .*set PASSIFLEX_CACHE"):
        path = compile_source(SOURCE)
    assert answer(path) == 42.0
    assert compile_source(SOURCE) == path  # a second warning would be an error here


def test_a_fallback_that_was_removed_is_made_again(cache, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(PassiflexWarning):
        first = compile_source(SOURCE)
    shutil.rmtree(first.parent)
    again = compile_source(SOURCE)
    assert again.is_file()
    assert again.parent.stat().st_mode & 0o777 == 0o700


def test_no_folder_at_all_is_one_line(cache, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("PASSIFLEX_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr("tempfile.mkdtemp", _no_folder)
    with (
        pytest.warns(PassiflexWarning),
        pytest.raises(CompilerError, match=r"no folder for compiled libraries; got .* try setting PASSIFLEX"),
    ):
        compile_source(SOURCE)


def _no_folder(**_):
    raise FileNotFoundError(2, "No usable temporary directory found")


def test_the_folder_of_a_process_outlives_its_forks(cache, monkeypatch, tmp_path):
    folder = library._process_folder(os.getpid())
    child = os.fork()
    if child == 0:
        other = library._process_folder(os.getpid())
        os._exit(int(other == folder))
    assert os.waitpid(child, 0)[1] == 0
    assert folder.is_dir()


SLOW = """#!/bin/sh
case "$*" in *--version*) exec echo slow;; esac
for word in "$@"; do
    case "$word" in *.c) grep -q probe "$word" && exec {cc} "$@";; esac
done
sleep 1000 &
echo "$$ $!" > {note}.new && mv {note}.new {note}
wait
"""


def runs(process: int) -> bool:
    """Return whether a process is there, and no zombie that nobody waits for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_process_leaves_no_compiler_and_no_folder(cache, tmp_path, number):
    found = find_compiler()
    if "zig" in found.identity:
        pytest.skip("no system compiler")
    slow, note = tmp_path / "slow", tmp_path / "note"
    slow.write_text(SLOW.format(cc=found.argv[0], note=note))
    slow.chmod(0o755)
    script = f"from passiflex.native import compile_source; compile_source({SOURCE!r})"
    with subprocess.Popen(
        [sys.executable, "-c", script], env=os.environ | {"CC": str(slow)}, stderr=subprocess.DEVNULL
    ) as process:
        wait_for(note.exists)
        compilers = [int(word) for word in note.read_text().split()]
        assert all(map(runs, compilers))
        assert [p.name[:6] for p in cache.iterdir()] == ["build-"]
        process.send_signal(number)
    wait_for(lambda: not any(map(runs, compilers)) and not list(cache.iterdir()))
    assert not list(tmp_path.glob("passiflex-*"))


def wait_for(condition):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


@pytest.mark.parametrize("length", [1, 200_000], ids=["heard", "gone while it is told"])
def test_a_builder_that_is_lost_is_one_line(cache, monkeypatch, length):
    """A pipe holds 64 kB: a longer text cannot be written to a process that is gone."""
    monkeypatch.setattr(compiler.builder, "__file__", "/nowhere/builder.py")
    with pytest.raises(CompilerError, match=r"the process that runs the compiler ended; got .*No such file"):
        compile_source(SOURCE + f"/* {'x' * length} */")
