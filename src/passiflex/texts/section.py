"""What every mapping of a file has in common, and how it is changed."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Self

from pydantic import AliasChoices, BaseModel, ConfigDict, model_validator

from passiflex.errors import ArgumentError, FrozenError
from passiflex.texts.mistakes import Mistakes as Mistakes

NOTHING: Mapping[str, Any] = MappingProxyType({})


class Section(BaseModel):
    """A mapping of a file; an entry that is left empty counts as left out."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_by_name=True, validate_by_alias=True)
    ways: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Of a section that can be written in one of several ways: the entries of each."""

    @model_validator(mode="before")
    @classmethod
    def _without_empty_entries(cls, written: Any) -> Any:
        if not isinstance(written, dict):
            return written
        known = {f.alias or name for name, f in cls.model_fields.items()} | set(cls.former_names())
        return {k: v for k, v in written.items() if v is not None or k not in known}

    @classmethod
    def former_names(cls) -> dict[str, str]:
        """Return former name → name of the entries that once had another, and are still read by it."""
        return {
            str(former): name
            for name, field in cls.model_fields.items()
            if isinstance(field.validation_alias, AliasChoices)
            for former in field.validation_alias.choices[1:]
        }

    @classmethod
    def from_former(cls, name: str, written: Any) -> Any:
        """Return what was written for an entry by its former name as the entry takes it by its new one."""
        return written

    def changed(self, entries: Mapping[str, Any] = NOTHING, /, **more: Any) -> Self:
        """Return a copy with other entries, validated as those of a file.

        Parameters
        ----------
        entries, more: By path, as `{"law.stiffness.translation": "50 N/m"}` or `{"reference[0].at": 1}`; or nested,
            as `law={"stiffness": {"translation": 50}}`. None leaves an entry out, so that its default counts.

        Raises
        ------
        ScenarioError
            With one line for each unknown name, with the nearest, and each value that does not fit.
        """
        from passiflex.texts.changes import changed

        if not isinstance(entries, Mapping):
            raise ArgumentError(entries, "a mapping", 'changed({"duration": 5}) or changed(duration=5)')
        return changed(self, {**entries, **more})

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy, with whole entries in place of its own; they are validated as those of a file.

        Raises
        ------
        ScenarioError
            As `changed`, which takes paths and parts of entries too.
        """
        from passiflex.texts.changes import replaced

        if not isinstance(update, Mapping | None):
            raise ArgumentError(update, "a mapping", 'model_copy(update={"duration": 5})')
        copy = super().model_copy(deep=deep)
        return replaced(copy, update) if update else copy

    if not TYPE_CHECKING:  # a type checker knows that a section is frozen

        def __setattr__(self, name: str, value: object) -> NoReturn:
            """Raise FrozenError."""
            known = type(self).model_fields
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.7)
            try_ = f"changed({near[0]}={value!r})" if near else "changed, with one of its own names"
            raise FrozenError(type(self).__name__, f"{name} = {value!r}", try_)

        def __delattr__(self, name: str) -> NoReturn:
            """Raise FrozenError."""
            field = type(self).model_fields.get(name)
            try_ = f"changed({name}={'...' if field is not None and field.is_required() else None})"
            raise FrozenError(type(self).__name__, f"del {name}", try_)
