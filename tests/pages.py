"""The blocks of the README and of the pages, and a walk through a page that runs them in their order."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import webbrowser
from collections.abc import Iterator
from contextlib import ExitStack, chdir
from functools import partial
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest
import yaml

from cli.shell import Shell
from worlds import merged

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "docs" / "examples"
PAGES = [
    ROOT / "README.md",
    *sorted(
        path for folder in (".", "notebooks", "reference") for path in (ROOT / "docs" / folder).glob("*.md")
    ),
]
FENCE = re.compile(r"^```(\S*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
MARK = re.compile(r"<!-- no-run(?:: (?P<reason>\w[^>]*?))? -->\n*\Z")
SLOW = re.compile(r"^passiflex (reproduce|search|limits|recommend)\b|--scheduler", re.MULTILINE)
EXTRA = re.compile(r"passiflex\[(\w+)\]")
ELLIPSIS = "…"

SMALLER = {
    "campaign arm3_campaign.yaml --out": "campaign arm3_campaign.yaml --samples 16 --out",
    "--samples 1000": "--samples 20",
    "--evaluations 400": "--evaluations 16",
}
"""What a page shows at its full size, and the tests run at a smaller one."""


LIBRARIES = {"rrd": "rerun", "mcap": "mcap_ros2"}
"""Word of a command → what it needs from an extra."""


RUNS = {"RUN.nc": "arm3_sampled.yaml", "OTHER.nc": "arm3_step.yaml"}
"""Run of a reader's own → what stands in for its scenario."""


class Block(NamedTuple):
    """A fenced block of a page.

    Attributes
    ----------
    line: Of its fence, from 1.
    mark: None, or why it is not run: the reason in `<!-- no-run: reason -->` above it; empty if there is none.
    """

    page: Path
    line: int
    language: str
    text: str
    mark: str | None

    @property
    def slow(self) -> bool:
        """Whether it takes more than a few seconds."""
        return self.language == "sh" and bool(SLOW.search(self.text))


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page; directives, as ```` ```{figure} ````, are Sphinx's business and not among them."""
    text = page.read_text(encoding="utf-8")
    for block in FENCE.finditer(text):
        if not block[1].startswith("{"):
            mark = MARK.search(text[: block.start()])
            line = text.count("\n", 0, block.start()) + 1
            yield Block(page, line, block[1], block[2], (mark["reason"] or "") if mark else None)


class Walk:
    """One page and one folder: each block runs once, after those above it, with the files that they made."""

    def __init__(self, page: Path, folder: Path):
        self._page, self._folder = page, folder
        self._printed: dict[int, str] = {}
        furnish(folder)

    def to(self, block: Block, shell: Shell, capsys: pytest.CaptureFixture[str]) -> str:
        """Run a block, before it those above it that have not run, slow ones left out. Return its output."""
        above = ""
        with chdir(self._folder), ExitStack() as stack:
            for b in blocks(self._page):
                if b.line > block.line:
                    break
                if b.line not in self._printed and b.mark is None and (b == block or not b.slow):
                    self._printed[b.line] = ""
                    self._printed[b.line] = _run(b, above, shell, capsys, stack)
                above = self._printed.get(b.line, "")
        return above


def furnish(folder: Path) -> None:
    """Put into a folder what the pages suppose to be there: the examples, and files of a reader's own."""
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)
    shipped = resources.files("passiflex.studies") / "scenarios"
    (folder / "fig1_sampled.yaml").write_text((shipped / "fig1_sampled.yaml").read_text(encoding="utf-8"))
    campaign = (folder / "arm3_campaign.yaml").read_text(encoding="utf-8")
    assert "samples: 200" in campaign
    for name in ("arm3_campaign.yaml", "CAMPAIGN.yaml"):
        (folder / name).write_text(campaign.replace("samples: 200", "samples: 14"), encoding="utf-8")
    for name in ("my_arm.yaml", "SCENARIO.yaml"):
        shutil.copy(folder / "arm3_sampled.yaml", folder / name)


def _run(block: Block, above: str, shell: Shell, capsys: pytest.CaptureFixture[str], stack: ExitStack) -> str:
    """Run one block in the current folder, and return what it printed."""
    match block.language:
        case "python":
            capsys.readouterr()
            run_python(block)
            return capsys.readouterr().out
        case "sh":
            return "".join(run_line(line, shell, stack) for line in lines(block.text))
        case "text":
            assert printed(block.text).search(above), f"not what was printed:\n{above}"
        case "yaml":
            validate(block.text, Path())
        case "toml":
            tomllib.loads(block.text)
        case other:
            raise AssertionError(f"no test knows what a block of {other or 'no language'} is")
    return ""


def run_python(block: Block) -> None:
    """Run a block as a program of its own, whose names are gone at its end; processes may be started from it."""
    module = ModuleType("__main__")
    before, sys.modules["__main__"] = sys.modules["__main__"], module
    try:
        exec(compile(block.text, f"{block.page.name}:{block.line}", "exec"), module.__dict__)
    finally:
        sys.modules["__main__"] = before


def lines(text: str) -> list[str]:
    """Return the commands of a block of shell, without comments."""
    joined = text.replace("\\\n", " ").splitlines()
    return [line for line in joined if shlex.split(line, comments=True)]


def run_line(line: str, shell: Shell, stack: ExitStack) -> str:
    """Run one command at its smaller size, or check it where running it is not the page's point."""
    for full, small in SMALLER.items():
        line = line.replace(full, small)
    words = shlex.split(line, comments=True)
    match words:
        case ["passiflex", *arguments]:
            for module in {LIBRARIES[word] for word in arguments if word in LIBRARIES}:
                pytest.importorskip(module)
            for word in RUNS.keys() & set(arguments):
                _make_run(word)
            result = shell(*(_address(word, stack) for word in arguments))
            assert result.status == 0, result.out + result.err
            return result.out
        case ["make", "-C", folder, target]:
            done = subprocess.run(["make", "-C", folder, target], capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            return done.stdout
        case ["make", target]:
            assert target in targets(), f"no target of the Makefile: {target}"
        case ["pip", "install", package]:
            assert set(EXTRA.findall(package)) <= extras(), f"no extra of the package: {package}"
        case _:
            raise AssertionError(f"no test knows the command: {line}")
    return ""


def _make_run(name: str) -> None:
    """Write a run of a reader's own into the current folder, unless it is there."""
    from passiflex.simulation import simulate

    if not Path(name).exists():
        simulate(RUNS[name]).save(name)


def targets() -> set[str]:
    """Return the targets of the Makefile."""
    return set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def extras() -> set[str]:
    """Return the extras of the package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return set(project["optional-dependencies"])


def _address(word: str, stack: ExitStack) -> str:
    """Return the word; for the address of a scheduler, that of one which is there until the block ends."""
    if not word.startswith("tcp://"):
        return word
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None)
    return str(stack.enter_context(cluster).scheduler_address)


def printed(text: str) -> re.Pattern[str]:
    """Return a pattern for output as a page shows it: whole lines, anything where there is an ellipsis."""
    shown = [
        ".*".join(re.escape(part.strip()) for part in line.split(ELLIPSIS))
        for line in text.strip().splitlines()
    ]
    return re.compile(r"[ \t]*\n[ \t]*".join(shown))


def validate(text: str, folder: Path) -> Any:
    """Return the robot, campaign or scenario that a YAML text is; a part of a scenario is put into a whole one.

    `folder` is where its files are looked for.
    """
    from passiflex.campaigns.campaign_file import parse_campaign
    from passiflex.robots import FlexibleJointRobot
    from passiflex.simulation import parse_scenario

    data = yaml.safe_load(text)
    if "urdf" in data:
        (folder / "shown_robot.yaml").write_text(text, encoding="utf-8")
        return FlexibleJointRobot.load(folder / "shown_robot.yaml")
    if "samples" in data:
        return parse_campaign(text, base_dir=folder)
    whole = {"name", "robot", "posture", "law", "duration"} <= data.keys()
    if not whole:
        around = yaml.safe_load((EXAMPLES / "arm3_sampled.yaml").read_text(encoding="utf-8"))
        text = yaml.safe_dump(merged(around, data))
    return parse_scenario(text, base_dir=folder)


@pytest.fixture
def without_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open no browser."""

    def none() -> None:
        raise webbrowser.Error("no browser in a test")

    monkeypatch.setattr(webbrowser, "get", none)


@pytest.fixture
def at_the_smaller_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the studies that take minutes run with a few robots and points."""
    from itertools import islice

    from passiflex.studies import reproduce, sensitivity
    from passiflex.studies.uncertainty import reproduce_uncertainty

    monkeypatch.setitem(reproduce.STUDIES, "uncertainty", partial(reproduce_uncertainty, samples=4))
    for name in ("step_variants", "circle_variants"):
        few = tuple(islice(getattr(sensitivity, name)(), 2))
        monkeypatch.setattr(sensitivity, name, lambda few=few: iter(few))
