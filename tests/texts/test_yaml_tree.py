"""The one reader of YAML: as PyYAML where YAML 1.1 and 1.2 agree, and in bounded time whatever it is given."""

from __future__ import annotations

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from passiflex.texts import yaml_tree
from passiflex.texts.yaml_tree import MOST_LINES, RefusedText, Tree, read_back

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**17), 10**17)
    | st.floats(allow_nan=False)
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=15,
)


@given(st.dictionaries(st.text(min_size=1, max_size=8), VALUES, min_size=1, max_size=5))
def test_what_pyyaml_writes_is_read_back(data: dict) -> None:
    assert Tree().read(yaml.safe_dump(data), "") == read_back(yaml.safe_dump(data)) == data


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("010", "010"),
        ("0x10", "0x10"),
        ("yes", "yes"),
        ("1:30", "1:30"),
        ("2001-99-99", "2001-99-99"),
        ("1_0", "1_0"),
    ],
)
def test_what_yaml_1_1_makes_of_a_word_is_not_made_of_it(written: str, value: str) -> None:
    assert Tree().read(f"a: {written}", "") == {"a": value}


def test_spans_are_where_the_values_are_written() -> None:
    text = "a: [1, 'two']\nb: three  # not four\n"
    tree = Tree()
    tree.read(text, "")
    assert {place: text[span] for place, span in tree.spans.items() if place} == {
        ("a",): "[1, 'two']",
        ("a", 0): "1",
        ("a", 1): "'two'",
        ("b",): "three",
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [" + "1," * 300_000, "more than 1000 entries"),
        ("[" * 300_000, "nested too deeply"),
        ("? " * 300_000, "nested too deeply"),
        ("a: &a [*a]", "line 1, column 4: nested too deeply"),
        (" " * 4_000_001, "longer than 4000000 characters"),
    ],
)
def test_no_text_is_read_further_than_it_can_be_used(
    text: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The work is counted: the parser hands over no more nodes than twice those that a tree may have."""
    monkeypatch.setattr(yaml_tree, "MAX_NODES", 1000)
    monkeypatch.setattr(yaml_tree, "TOO_MANY", "more than 1000 entries")
    nodes: list[yaml_tree._Bounded] = []
    start = yaml_tree._Bounded.__init__
    monkeypatch.setattr(
        yaml_tree._Bounded, "__init__", lambda self, t: (nodes.append(self), start(self, t))[1]
    )
    with pytest.raises(RefusedText, match=message):
        Tree().read(text, "")
    assert all(loader.nodes <= 2001 for loader in nodes)


def test_of_very_many_mistakes_the_first_are_shown() -> None:
    tree = Tree()
    tree.read("a: 1\n" * 1000, "")
    lines = tree.lines()
    assert len(lines) == MOST_LINES + 1
    assert lines[0] == "line 2, column 1, a: twice in one mapping, first in line 1; remove one"
    assert lines[-1] == "and 899 more"
