"""How much memory the program may keep for speed: one budget, shared by what keeps something."""

from __future__ import annotations

import os
from dataclasses import dataclass

from tracker.runs.stage_cache import MEMORY_BYTES
from tracker.sequences.pictures.frames import CACHE_BYTES

LEAST_BYTES = 64 << 20
"""Less keeps no second of pictures, and everything is computed twice."""


@dataclass(frozen=True, slots=True)
class Budget:
    """Bounds, in bytes, that add up to three quarters of the whole; a run takes the rest."""

    pictures: int
    """Decoded pictures."""
    columns: int
    """Columns of runs."""

    @staticmethod
    def of(total: int | None = None) -> Budget:
        """The parts of a budget.

        Args:
            total: Bytes; None for half of the machine's memory, of which the caches then take no
                more than is usual.
        """
        if total is not None:
            return Budget(max(LEAST_BYTES, total) // 4, max(LEAST_BYTES, total) // 2)
        half = max(LEAST_BYTES, machine_memory() // 2)
        return Budget(min(CACHE_BYTES, half // 4), min(MEMORY_BYTES, half // 2))


def machine_memory() -> int:
    """Bytes of memory that this machine has; 8 GB where it does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 8 << 30
