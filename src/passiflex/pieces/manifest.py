"""What a campaign's folder holds: which campaign, of how many samples, computed by which code."""

from __future__ import annotations

import dataclasses
import difflib
import json
import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from passiflex.errors import PassiflexError
from passiflex.files import whole_file
from passiflex.pieces.source import source_digest

FORMAT = "passiflex campaign 1"
NAME = "manifest.json"


class FolderError(PassiflexError):
    """A folder does not hold the campaign that is asked for, or what it holds is damaged."""


@dataclass(frozen=True)
class Manifest:
    """Of a campaign's folder.

    Attributes
    ----------
    campaign: The text that the work is given.
    identity: What must be the same for rows to belong together; the text, but for the number of samples.
    samples: How many.
    piece: Samples of a piece.
    source: Digest of the source that the rows come from.
    version, commit: Of the package, for the reader.
    started: When the first run was, UTC.
    """

    campaign: str
    identity: str
    samples: int
    piece: int
    source: str
    version: str
    commit: str
    started: str
    format: str = FORMAT

    def save(self, folder: Path) -> None:
        """Write it, whole or not at all."""
        with whole_file(folder / NAME) as temporary, temporary.open("w", encoding="utf-8") as file:
            json.dump(dataclasses.asdict(self), file, indent=2, ensure_ascii=False)
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
        return dataclasses.replace(self, campaign=campaign, samples=samples)


def new_manifest(campaign: str, identity: str, samples: int, piece: int) -> Manifest:
    """Return the manifest of a campaign that starts now."""
    from passiflex.simulation.run import package_version, source_commit  # seconds to import: only at a start

    now = datetime.now(UTC).isoformat(timespec="seconds")
    return Manifest(
        campaign, identity, samples, piece, source_digest(), package_version(), source_commit(), now
    )


def load_manifest(folder: Path) -> Manifest:
    """Return the manifest of a folder.

    Raises
    ------
    FolderError
        If there is none, or it is damaged or of another format.
    """
    try:
        content = json.loads((folder / NAME).read_text(encoding="utf-8"))
        found = content.get("format")
        if found == FORMAT:
            return Manifest(**content)
    except (FileNotFoundError, NotADirectoryError):
        raise FolderError(f"{folder} holds no campaign", got=f"no {NAME}") from None
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise FolderError(f"{folder / NAME} is damaged", got=error, try_="another folder") from error
    raise FolderError(f"{folder} is of another version", got=repr(found), needs=repr(FORMAT))


def _difference(before: str, now: str) -> str:
    """Return the first line that differs, as it was and is."""
    lines = difflib.ndiff(before.splitlines(), now.splitlines())
    changed = [line for line in lines if line[:2] in ("- ", "+ ")]
    was = next((line[2:].strip() for line in changed if line[0] == "-"), "nothing")
    new = next((line[2:].strip() for line in changed if line[0] == "+"), "nothing")
    return f"{was!r} there, {new!r} asked for"[:300]
