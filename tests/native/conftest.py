"""The tests of native code compile it as hard as a user does, whatever the others do."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def as_users_have_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PASSIFLEX_OPTIMISE", "2")
