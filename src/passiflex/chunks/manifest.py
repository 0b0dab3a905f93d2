"""What a campaign's folder holds: which campaign, of how many samples, computed by which code."""

from __future__ import annotations

import difflib
import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from passiflex.chunks.source import source_digest
from passiflex.errors import PassiflexError
from passiflex.files import read_json, read_regular, whole_file
from passiflex.origin import package_version, source_commit

FORMAT = "passiflex campaign 1"
NAME = "manifest.json"
MOST = 999_999_999
"""Most samples, as the names of chunks have nine digits."""
MOST_BYTES = 16_000_000
Word = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.+!-]+$", max_length=100)]


class FolderError(PassiflexError):
    """A folder does not hold the campaign that is asked for, or what it holds is damaged."""


class Manifest(BaseModel):
    """Of a campaign's folder.

    Attributes
    ----------
    campaign: The text that the work is given.
    identity: What must be the same for rows to belong together; the text, but for the number of samples.
    samples: How many.
    piece: Samples of a chunk, by the name that the file has for it.
    source: Digest of the source that the rows come from.
    version, commit: Of the package, for the reader.
    started: When the first run was, UTC.
    runs: Files of full runs that the campaign has written: what it may remove again.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    campaign: str
    identity: str
    samples: Annotated[int, Field(ge=1, le=MOST)]
    piece: Annotated[int, Field(ge=1, le=MOST)]
    source: Word
    version: Word
    commit: Word
    started: str
    format: str = FORMAT
    runs: list[Annotated[str, Field(pattern=r"^sample_\d+\.nc$")]] = []

    def save(self, folder: Path) -> None:
        """Write it, whole or not at all."""
        with (
            whole_file(folder / NAME, parents=False) as temporary,
            temporary.open("w", encoding="utf-8") as file,
        ):
            json.dump(self.model_dump(), file, indent=2, ensure_ascii=False)
            file.flush()
            os.fsync(file.fileno())

    def continued(self, campaign: str, identity: str, samples: int, extends: bool) -> Manifest:
        """Return the manifest of going on with this campaign, to as many samples.

        Raises
        ------
        FolderError
            If it is another campaign, other code, or a number of samples that does not go on from this one;
            the message says what differs.
        """
        differs = []
        if identity != self.identity:
            differs.append(f"the campaign: {_difference(self.identity, identity)}")
        if source_digest() != self.source:
            was = f"version {self.version}, commit {self.commit}"
            differs.append(f"the source of the package: the rows are from {was}, source {self.source}")
        if samples < self.samples and not differs:
            raise FolderError(
                "the campaign in this folder has more samples",
                got=str(samples),
                needs=f"{self.samples} or more",
                try_=f"--samples {self.samples}",
            )
        if samples > self.samples and not extends:
            differs.append(
                f"the number of samples: {self.samples} → {samples}, and this sampling cannot be extended"
            )
        if differs:
            raise FolderError(
                "the folder holds rows of another campaign", got="; ".join(differs), try_="another folder"
            )
        return self.model_copy(update={"campaign": campaign, "samples": samples})


def new_manifest(campaign: str, identity: str, samples: int, chunk: int) -> Manifest:
    """Return the manifest of a campaign that starts now."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return Manifest(
        campaign=campaign,
        identity=identity,
        samples=samples,
        piece=chunk,
        source=source_digest(),
        version=package_version(),
        commit=source_commit(),
        started=now,
    )


def load_manifest(folder: Path) -> Manifest:
    """Return the manifest of a folder.

    Raises
    ------
    FolderError
        If there is none, or it is damaged or of another format.
    """
    path = folder / NAME
    try:
        content = read_json(read_regular(path, MOST_BYTES).decode("utf-8"))
        if not isinstance(content, dict):
            raise ValueError("no mapping")
    except (FileNotFoundError, NotADirectoryError):
        raise FolderError(f"{folder} holds no campaign", got=f"no {NAME}") from None
    except (OSError, ValueError) as error:
        raise FolderError(f"{path} is damaged", got=error, try_="another folder") from error
    if content.get("format") != FORMAT:
        got = repr(content.get("format"))[:80]
        raise FolderError(f"{folder} is of another version", got=got, needs=repr(FORMAT))
    try:
        return Manifest.model_validate(content)
    except ValidationError as error:
        got = _mistakes(error, content)
        raise FolderError(f"{path} is damaged", got=got, try_="another folder") from error


def _mistakes(error: ValidationError, content: dict[str, Any]) -> str:
    """Return what is wrong, in the words that a scenario's mistakes have."""
    from passiflex.texts.model_mistakes import explained  # slow to import: only where something is wrong
    from passiflex.texts.yaml_tree import dotted

    return "; ".join(f"{dotted(place)}: {said}" for place, said, _ in explained(error, content, Manifest))


def _difference(before: str, now: str) -> str:
    """Return the first line that differs, as it was and is."""
    lines = difflib.ndiff(before.splitlines(), now.splitlines())
    changed = [line for line in lines if line[:2] in ("- ", "+ ")]
    was = next((line[2:].strip() for line in changed if line[0] == "-"), "nothing")
    new = next((line[2:].strip() for line in changed if line[0] == "+"), "nothing")
    return f"{was!r} there, {new!r} asked for"[:300]
