"""What every mapping of a file has in common, and how it reports mistakes."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator


class Mistakes(ValueError):  # noqa: N818 - one exception for all of them
    """Mistakes found in one value, each with its place below that value."""

    def __init__(self, *entries: tuple[tuple[str | int, ...], str]):
        self.entries = entries
        super().__init__("; ".join(".".join(map(str, (*place, text))) for place, text in entries))


class Section(BaseModel):
    """A mapping of a file; an entry that is left empty counts as left out."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_by_name=True, validate_by_alias=True)

    @model_validator(mode="before")
    @classmethod
    def _without_empty_entries(cls, written: Any) -> Any:
        if not isinstance(written, dict):
            return written
        known = {f.alias or name for name, f in cls.model_fields.items()}
        return {k: v for k, v in written.items() if v is not None or k not in known}
