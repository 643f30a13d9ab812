"""What was taught and not saved, by the folder of its sequence: kept for the next start too."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from tracker.files.validated import read_as, set_aside, write_json
from tracker.sequences.built_in import earlier_key, key_of
from tracker.sequences.writing.teaching import Values, changes

logger = logging.getLogger("app")


@dataclass(frozen=True, slots=True)
class _Draft:
    """A draft as its file has it."""

    saved: Values
    """Room and templates as they were saved, by the keys of a ``sequence.toml``."""
    taught: Values
    """Room and templates as they were taught since."""


class Drafts:
    """One draft a sequence folder: room and templates as saved, and as taught since."""

    def __init__(self, folder: Path | None) -> None:
        """Keep them in a folder, a file each; in memory for this start where there is none."""
        self._folder = folder
        self._kept: dict[Path, tuple[Values, Values]] = {}

    def keep(self, sequence: Path, saved: Values, taught: Values) -> None:
        """Keep what is not saved of a sequence, instead of what was before; nothing, if all is."""
        if saved == taught:
            self.forget(sequence)
            return
        self._kept[sequence] = saved, taught
        if self._folder is None:
            return
        draft = {"sequence": str(sequence), "saved": saved, "taught": taught}
        try:
            write_json(self._file(sequence), draft)
        except OSError as error:
            logger.warning("what is not saved of %s would be lost at an end: %s", sequence, error)

    def read(self, sequence: Path) -> tuple[Values, Values] | None:
        """As saved and as taught; None where all was saved, or the file cannot be read."""
        if self._folder is None or sequence in self._kept:
            return self._kept.get(sequence)
        draft = _read(self._file(sequence))
        if draft is not None:
            self._kept[sequence] = draft
        return draft

    def take_earlier(self, sequence: Path) -> tuple[Values, Values] | None:
        """What was saved and taught on a built-in room as it was rendered before; None where
        nothing was. The file gets another name, so that it is taken up once and nothing is lost."""
        key = earlier_key(sequence)
        if self._folder is None or key is None:
            return None
        path = self._folder / f"{key}.json"
        draft = _read(path)
        if draft is not None:
            path.rename(path.with_suffix(".taken-up.json"))
        return draft

    def forget(self, sequence: Path) -> None:
        """All of it is saved, or it cannot be taken up any more."""
        self._kept.pop(sequence, None)
        if self._folder is not None:
            self._file(sequence).unlink(missing_ok=True)

    def file_of(self, sequence: Path) -> Path | None:
        """The file of a draft; None where there is none."""
        kept = self._folder is not None and sequence in self._kept
        return self._file(sequence) if kept else None

    def _file(self, sequence: Path) -> Path:
        assert self._folder is not None
        return self._folder / f"{key_of(sequence)}.json"


def _read(path: Path) -> tuple[Values, Values] | None:
    try:
        draft = read_as(path, _Draft)
        changes(draft.saved, draft.taught)  # raises where another version wrote them
        return draft.saved, draft.taught
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        aside = set_aside(path)
        logger.warning("%s cannot be read and is now %s: %s", path, aside or path, error)
        return None
