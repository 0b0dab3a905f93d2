"""What the attributes of a run have to be; a file may come from anybody."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import xarray as xr
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError

from passiflex.files import read_json
from passiflex.texts.quantity import shown
from passiflex.texts.text_file import MAX_BYTES

LONGEST_NAME, LONGEST_TEXT = 1_000, 100_000
LONGEST_UNIT = 200


def _json(text: str, kind: type) -> str:
    value = read_json(text)
    if not isinstance(value, list if kind is list else dict):
        raise ValueError(f"expected {'a list' if kind is list else 'a mapping'} as JSON")
    return text


def _events(text: str) -> str:
    if not all(isinstance(event, dict) for event in read_json(_json(text, list))):
        raise ValueError("expected a list of mappings as JSON")
    return text


def _mapping(text: str) -> str:
    return _json(text, dict)


def _elements(text: str) -> str:
    """Return the text if it is a list of [name, whether outside, whether it stores energy, and is supplied with it]."""
    for entry in read_json(_json(text, list)):
        kinds = [type(part) for part in entry] if isinstance(entry, list) else []
        if kinds not in ([str, bool, bool], [str, bool, bool, bool]):
            raise ValueError(
                "expected a list of name, whether outside the robot, whether it stores energy, and is supplied with it"
            )
    return text


Name = Annotated[str, Field(max_length=LONGEST_NAME)]
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
Positive = Annotated[float, Field(ge=0, allow_inf_nan=False)]
KINDS: dict[str, Any] = {
    "format": Name,
    "name": Name,
    "robot": Name,
    "robot_description": Text,
    "joint_parameters": Annotated[Text, AfterValidator(_mapping)],
    "law": Name,
    "scenario": Annotated[str, Field(max_length=MAX_BYTES)],
    "sources": Annotated[Text, AfterValidator(_mapping)],
    "seed": Annotated[int, Field(ge=0)],
    "unbooked": Text,
    "elements": Annotated[Text, AfterValidator(_elements)],
    "has_tank": Annotated[int, Field(ge=0, le=1)],
    "control_period": Positive,
    "version": Name,
    "commit": Name,
    "engine": Name,
    "events": Annotated[str, Field(max_length=MAX_BYTES), AfterValidator(_events)],
    "failure": Text,
    "duration": Positive,
    "tolerance": Positive,
}
"""Attribute → what it is."""
_ADAPTERS = {name: TypeAdapter(kind, config=ConfigDict(strict=True)) for name, kind in KINDS.items()}


FORMER = {"configuration": "scenario"}
"""Attributes by the names that they had in files of before."""


def renamed(data: xr.Dataset) -> xr.Dataset:
    """Return the signals with attributes by the names that they have now."""
    old = {former: now for former, now in FORMER.items() if former in data.attrs and now not in data.attrs}
    data.attrs = {old.get(str(name), name): value for name, value in data.attrs.items()}
    return data


def wrong_attributes(attributes: Mapping[Any, Any]) -> dict[str, str]:
    """Return what is wrong with attributes of a run that are there, by their names."""
    wrong = {}
    for name, adapter in _ADAPTERS.items():
        if name not in attributes:
            continue
        value = attributes[name]
        try:
            adapter.validate_python(value.item() if isinstance(value, np.generic) else value)
        except ValidationError as error:
            said = error.errors(include_url=False)[0]["msg"]
            wrong[name] = f"{said[0].lower()}{said[1:]}; got {shown(value)}"
    return wrong


def wrong_units(data: xr.Dataset) -> list[str]:
    """Return the signals whose unit or meaning is no text, or a long one."""
    return [
        str(name)
        for name, values in data.variables.items()
        if not all(_is_word(values.attrs.get(about, "")) for about in ("units", "long_name"))
    ]


def without_units(data: xr.Dataset, names: list[str]) -> xr.Dataset:
    """Return the signals, some of them without unit and meaning."""
    out = data.copy()
    for name in names:
        kept = {k: v for k, v in out[name].attrs.items() if k not in ("units", "long_name")}
        out[name].attrs = kept
    return out


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= LONGEST_UNIT
