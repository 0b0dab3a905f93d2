"""Several mistakes in one value, as one exception."""

from __future__ import annotations


class Mistakes(ValueError):  # noqa: N818 - one exception for all of them
    """Mistakes found in one value, each with its place below that value."""

    def __init__(self, *entries: tuple[tuple[str | int, ...], str]):
        self.entries = entries
        super().__init__("; ".join(".".join(map(str, (*place, text))) for place, text in entries))
