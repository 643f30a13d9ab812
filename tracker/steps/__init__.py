"""One value a step, stored as a few long arrays instead of many small objects.

A result of one step has dozens of arrays of a few rows: as objects they take four times the memory
of their numbers. :class:`Steps` follows the fields of the results' dataclass and concatenates the
rows of each field over many steps, with the number of rows of each step beside them. Every value
comes back with its bits, shapes and types of number; a field needs no change here to be stored.
"""

from __future__ import annotations

from tracker.steps.columns import ROWS_SECOND
from tracker.steps.steps import Ragged, Steps

__all__ = ["ROWS_SECOND", "Ragged", "Steps"]
