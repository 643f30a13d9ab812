"""How the renderer's loops are compiled: as the engine's kernels, and not counted among them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from tracker.kernels.compilation import compiled_later

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    """Compile on the first call, keep the machine code on disk, release the interpreter.

    Every operation is rounded as written: products and sums drawn together where a processor can
    (``fastmath``) gave other pictures on other machines, and one of them other tracks.
    """
    return compiled_later(function)
