"""The table: of each kind of file, each damage with the sentence that refuses it.

``table.toml`` has a section for each kind of :mod:`tests.bad_input.kinds`. Its keys are the damages
that can be done to any file, or names of other files that stand in its place; ``edits`` are changes
of its text, from one text to another (an empty first one is the whole file). A sentence stands
there in full, but for ``…``, which is any text, and FOLDER; an empty sentence means that the file
is taken as it is.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.bad_input.contents import CONTENTS, FOREIGN
from tests.bad_input.damage import OF_A_FILE

TABLE = Path(__file__).with_name("table.toml")


@dataclass(frozen=True, slots=True)
class Row:
    """One file, one damage, one sentence."""

    kind: str
    file: str
    """The file that is damaged, in its folder."""
    damage: str
    """What is done to it: one of :mod:`tests.bad_input.damage`, a name of
    :mod:`tests.bad_input.contents`, or ``edit`` for a change of its text."""
    sentence: str
    """Empty where the file is taken as it is."""
    old: str | None = None
    new: str | None = None

    def apply(self, folder: Path) -> Path:
        """Do the damage in a folder; the file's path."""
        path = folder / self.file
        if self.new is not None:
            text = path.read_text(encoding="utf-8")
            assert str(self.old) in text, f"{self.old} is not in {self.file}"
            changed = text.replace(str(self.old), self.new, 1) if self.old else self.new
            path.write_text(changed, encoding="utf-8")
        elif self.damage in OF_A_FILE:
            OF_A_FILE[self.damage](path, 0.5, 0)
        else:
            path.write_bytes({**CONTENTS, **FOREIGN}[self.damage])
        return path

    def __str__(self) -> str:
        what = self.damage if self.new is None else f"{self.old} → {self.new}"
        return f"{self.kind}: {what}"[:60].encode("ascii", "replace").decode()

    def matches(self, sentence: str, folder: Path) -> bool:
        """Whether a sentence is the row's, for files that lie in a folder."""
        return re.fullmatch(self._pattern(folder), sentence) is not None

    def is_in(self, words: str, folder: Path) -> bool:
        """Whether a longer sentence, which may begin with a capital letter, holds the row's."""
        return re.search(self._pattern(folder), words, re.IGNORECASE) is not None

    def _pattern(self, folder: Path) -> str:
        expected = re.escape(self.sentence).replace("…", ".*")
        return re.sub(r"\bFOLDER", lambda _: re.escape(str(folder)), expected)


def _repeated(text: str) -> str:
    """A text in which ``{x*400}`` stands for 400 times x."""
    return re.sub(r"\{([^{}]+)\*(\d+)\}", lambda found: found[1] * int(found[2]), text)


@cache
def rows() -> tuple[Row, ...]:
    """All of them, in the order of the file."""
    found: list[Row] = []
    for kind, section in tomllib.loads(TABLE.read_text(encoding="utf-8")).items():
        file, edits = section.pop("file", ""), section.pop("edits", [])
        found += [Row(kind, file or damage, damage, said) for damage, said in section.items()]
        found += [
            Row(kind, file, "edit", said, _repeated(old), _repeated(new))
            for old, new, said in edits
        ]
    return tuple(found)
