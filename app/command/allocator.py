"""How the C library's allocator treats large arrays, where it can be told."""

from __future__ import annotations

import ctypes
import sys

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Parameters of glibc's ``mallopt``, as ``malloc.h`` numbers them."""

LARGE = 1 << 20
"""Bytes from which an array has pages of its own, which are the system's again once it is freed."""


def return_large_arrays() -> None:
    """Let memory that large arrays had go back to the system.

    glibc raises its threshold to the largest array that was freed, up to 32 MB: from then on such
    arrays lie on the heap, where anything that is allocated behind them keeps their memory. After
    a long run that is as much as the run itself. A threshold that is set stays. Elsewhere nothing
    is done.
    """
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, LARGE)
        mallopt(_TRIM_THRESHOLD, LARGE)
