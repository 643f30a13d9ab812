"""Rows of several arrays that belong together: selected and concatenated as one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
from numpy import ndarray


class Table:
    """The base of dataclasses whose fields, its slots, are all arrays with one row per item."""

    __slots__: ClassVar[tuple[str, ...]] = ()

    def take(self, rows: ndarray | slice) -> Self:
        """Select some of the rows, by mask, index or slice."""
        return type(self)(*(getattr(self, name)[rows] for name in type(self).__slots__))

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Concatenate the rows of one table or more."""
        return cls(
            *(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__)
        )
