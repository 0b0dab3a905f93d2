"""Elements of which there may be several: each has a label, by which its fields are told from those of the others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from passiflex.elements.element import AbstractElement
from passiflex.layout import Field, Layout


class AbstractLabelled(AbstractElement):
    """An element with a label of its own.

    Attributes
    ----------
    label: What a run calls it.
    """

    label: str

    @property
    def name(self) -> str:
        """Return what a run calls it."""
        return self.label

    def _called(self, *fields: Field) -> Layout:
        """Return fields by names that begin with the label."""
        return Layout(tuple(f._replace(name=f"{self.label}_{f.name}") for f in fields))

    def _own(self, view: Any, fields: Layout) -> Any:
        """Return its part of a view, by names without the label."""
        begin = len(self.label) + 1
        return SimpleNamespace(**{f.name[begin:]: getattr(view, f.name) for f in fields})
