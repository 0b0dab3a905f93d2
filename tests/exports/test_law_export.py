"""A law as C: it compiles without a word, and commands what Python commands, here to the last bit."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from cli.shell import Shell
from onboard.test_controller import planar
from passiflex.errors import NameUnknownError, UnstableLoopError
from passiflex.exports import export_law
from passiflex.exports.law_export import AS_THEY_ARE
from passiflex.files import OutputError

pytestmark = pytest.mark.skipif(not (shutil.which("make") and shutil.which("cc")), reason="no make and no cc")
STRICT = "-O1 -Werror"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_law(
        planar(actions={"follow_velocity": 1}), tmp_path_factory.mktemp("law") / "new", ["q", "dq", "tau_a"]
    )


def run(folder: Path, *words: str) -> str:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_it_compiles_without_a_word_and_commands_the_same(folder: Path) -> None:
    said = run(folder, "make", "check", f"CFLAGS={STRICT}")
    assert "warning" not in said
    assert "1000 steps" in said
    (worst,) = re.findall(r"largest difference (\S+) N m", said)
    assert float(worst) < 1e-11


@pytest.mark.skipif(
    "PASSIFLEX_COMPILER" in os.environ or "CC" in os.environ, reason="another compiler in Python"
)
def test_with_the_flags_of_python_it_is_equal_to_the_last_bit(folder: Path) -> None:
    level = os.environ.get("PASSIFLEX_OPTIMISE", "2")
    same = "-std=c99 -ffp-contract=fast -fno-math-errno -march=native"
    assert " 0 torques not equal to the last bit" in run(folder, "make", "same", f"SAME={same} -O{level}")


def test_no_sanitiser_has_a_word_to_say(folder: Path) -> None:
    assert "1000 steps" in run(folder, "make", "sanitised")


def test_a_wrong_number_is_seen_by_its_test(folder: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong"
    shutil.copytree(folder, wrong)
    text = (wrong / "pf_law.c").read_text()
    (stiffness,) = re.findall(r"\.joint_stiffness = \{([0-9.]+)", text)
    (wrong / "pf_law.c").write_text(text.replace(f"{{{stiffness}", f"{{{float(stiffness) * 1.0001!r}", 1))
    done = subprocess.run(["make", "check"], cwd=wrong, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "1000 steps" in done.stdout


def test_the_example_and_the_class_of_cpp_run(folder: Path, tmp_path: Path) -> None:
    assert "us a step on average" in run(folder, "make", "example", f"CFLAGS={STRICT}") + run(
        folder, "./example"
    )
    if shutil.which("c++") is None:
        pytest.skip("no C++ compiler")
    (tmp_path / "main.cpp").write_text(
        '#include "pf_law.hpp"\n'
        "int main() { pf::Law law(pf_law_example_said); law.step(pf_law_example_said); law.stop();\n"
        "  return law.state().torque[0] < 1e-9 && !law.stopped() ? 0 : 1; }\n"
    )
    strict = ["-Wall", "-Wextra", "-pedantic", "-Werror", "-std=c++17"]
    run(
        folder,
        "c++",
        *strict,
        f"-I{folder}",
        str(tmp_path / "main.cpp"),
        "libpf_law.a",
        "-o",
        str(tmp_path / "main"),
    )
    run(tmp_path, "./main")


@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_cmake_builds_and_tests_it(folder: Path, tmp_path: Path) -> None:
    run(folder, "cmake", "-S", str(folder), "-B", str(tmp_path / "built"))
    run(folder, "cmake", "--build", str(tmp_path / "built"))
    run(tmp_path / "built", "ctest", "--output-on-failure")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("qemu-aarch64") is None, reason="no qemu-aarch64")
def test_another_processor_commands_the_same(folder: Path, tmp_path: Path) -> None:
    """aarch64, which contracts products by itself unless told otherwise."""
    pytest.importorskip("ziglang")
    built = str(tmp_path / "test")
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", "aarch64-linux-musl"]
    run(folder, *zig, "-std=c99", "-O2", "-ffp-contract=off", "test_pf_law.c", "pf_law.c", "-lm", "-o", built)
    said = run(folder, "qemu-aarch64", built, "test_rows.txt", "1e-9")
    assert float(re.findall(r"largest difference (\S+) N m", said)[0]) < 1e-10


def test_only_what_it_promises_is_seen_and_only_libm_is_needed(folder: Path) -> None:
    run(folder, "make", "libpf_law.a")
    if shutil.which("nm") is None:
        pytest.skip("no nm")
    symbols = [
        line.split()[-2:] for line in run(folder, "nm", "libpf_law.a").splitlines() if len(line.split()) >= 2
    ]
    given = {name for kind, name in symbols if kind in "TDRB"}
    assert given == {
        *(f"pf_law_{name}" for name in ("init", "reset_at", "step", "stop", "resume", "stopped")),
        "pf_law_default_numbers",
        "pf_law_example_said",
    }
    assert not [name for kind, name in symbols if kind in "dbCB"]  # nothing that is written to
    needed = {name for kind, name in symbols if kind == "U"}
    of_libm = "sin cos sincos atan2 exp pow fmax fmin floor sqrt acos asin tan tanh log fabs"
    assert needed <= {*of_libm.split(), "memset", "memcpy", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}


def test_the_header_has_every_number_with_its_unit(folder: Path) -> None:
    header = (folder / "pf_law.h").read_text(encoding="utf-8")
    members = re.findall(r"^ +double \w+(?:\[\d+\])*; /\* (.*?): ", header, re.MULTILINE)
    assert len(members) > 150
    assert all(members)
    told = yaml.safe_load((folder / "numbers.yaml").read_text(encoding="utf-8"))
    assert told["model"]["joint_stiffness"]["unit"] == "N m/rad"
    assert told["robot"]["says_theta"]["value"] == 0
    assert sorted(p.name for p in folder.iterdir() if p.name in AS_THEY_ARE) == sorted(AS_THEY_ARE)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds something else"):
        export_law(planar(), tmp_path)
    with pytest.raises(NameUnknownError, match="tau_b"):
        export_law(planar(), tmp_path / "new", ["q", "tau_b"])
    with pytest.raises(UnstableLoopError):
        export_law(planar(), tmp_path / "new", ["q"])
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


def test_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scenario = tmp_path / "arm.yaml"
    scenario.write_text(planar().to_yaml())
    made = Shell(monkeypatch, capsys)("export-law", scenario, "--out", tmp_path / "law", "--says", "q, tau_a")
    assert (made.status, made.out) == (0, f"wrote {tmp_path / 'law'}\n")
    assert "q, tau_a." in (tmp_path / "law" / "pf_law.h").read_text(encoding="utf-8")
