"""What a server is started with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.web.access.tokens import Keys
from tracker.library import KEEP
from tracker.library.records import Result


@dataclass(frozen=True, slots=True)
class Settings:
    """What a server is started with."""

    host: str = "127.0.0.1"
    keys: Keys | None = None
    """What lets in; None: whoever reaches it."""
    sequence: str | None = None
    """Opened at once, in the background."""
    data: Path | None = None
    """Its folders are sequences that can be chosen."""
    detector: Path | None = None
    """A detection network (ONNX) that may be run on the pictures of each."""
    seed: int = 0
    with_viser: bool = True
    keep_on_disk: bool = False
    """Whether what was compiled and what the cameras found is kept for the next start."""
    library: Path | None = None
    """The file that keeps runs; None: they are not kept."""
    keep: int = KEEP
    """How many untouched runs stay in it."""
    memory: int | None = None
    """Bytes that may be kept for speed; None for half of the machine, or less."""
    disk: int | None = None
    """Bytes on disk that may be kept of earlier runs' stages; None for the usual limit."""
    run: int | Result | None = None
    """A run of it that is shown at once, instead of a sequence; or one that lies elsewhere, which
    is only looked at: nothing is computed, and nothing can be changed."""
    say: Callable[[str], None] = lambda words: None
    """Told what somebody in front of the terminal should know."""
    ended: tuple[int, int] | None = None
    """Process and signal of the start before this one, where it crashed."""
