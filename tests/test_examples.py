"""Each example answers its question, alone or after those that it names, in a folder with the files of the pages."""

from __future__ import annotations

import re
import runpy
import shutil
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
AFTER = {"replay_the_worst": ["campaign"], "look_at_it": ["campaign", "replay_the_worst"]}
SAYS = {
    "a_step": r"after 2 s: 5\.\d\d cm of 5 cm.*\nthe run was passive",
    "my_arm": r"15 N push it down by 5\.\d cm",
    "which_gains": r"(?s)hold.*control:\n  rate: 1000\.0",
    "why_it_trembles": r"(?s)joint 1 trembles at \d+ Hz.*remedy: .*\d+ Hz at joint 1",
    "circle_with_tank": r"(?s)granted \d\.\d+ J.*the run was passive",
    "campaign": r"32 of 32 passive, least margin 0\.\d+ J",
    "replay_the_worst": r"sample \d+ was passive: 0\.\d+ J were left",
    "look_at_it": r"worst\.html",
    "own_tank": "passive",
    "own_element": r"\de-\d\d",
    "own_law": r"up by (4\.9|5\.0)\d cm of 5 cm; the run was passive",
    "own_sensor": r"passive 0\.\d+",
    "policy_stream": r"(?s)in time: .* \d\.\d cm off, and the run was passive.*messages: .*was passive",
    "own_motion": r"passive 0\.0[67]",
}
"""What of its answer can be known beforehand."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("examples")
    shutil.copytree(ROOT / "docs" / "examples", made, dirs_exist_ok=True)
    return made


def run(name: str) -> None:
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_answers_its_question(
    path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    for name in AFTER.get(path.stem, []):
        run(name)
    capsys.readouterr()
    run(path.stem)
    assert re.search(SAYS[path.stem], capsys.readouterr().out)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_says_what_it_needs_and_asks_one_question(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    header = re.match(r"# /// script\n((?:# .*\n)+?)# ///\n\"\"\"(.+)\"\"\"\n", text)
    assert header is not None
    needs = tomllib.loads(header[1].replace("# ", ""))
    assert needs == {"requires-python": ">=3.11", "dependencies": ["passiflex"]}
    assert header[2].count("?") == 1
    assert len(text.splitlines()) < 60


def test_every_example_is_known() -> None:
    assert {path.stem for path in EXAMPLES} == set(SAYS)
