"""The claims of the papers, run again: ``multiview-phd experiment NAME``.

One module a claim in :mod:`tracker.experiments.claims`; its ``EXPERIMENT`` is entered in
:mod:`tracker.experiments.registry`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from tracker.experiments.laboratory.experiment import (
    Context,
    Experiment,
    Finding,
    RandomRooms,
    Result,
    Unavailable,
    Verdict,
)

if TYPE_CHECKING:
    from tracker.experiments.registry import EXPERIMENTS

__all__ = [
    "EXPERIMENTS",
    "Context",
    "Experiment",
    "Finding",
    "RandomRooms",
    "Result",
    "Unavailable",
    "Verdict",
]


def __getattr__(name: str) -> Any:
    """The list of all is made when it is asked for: whoever needs the laboratory alone waits
    for no experiment."""
    if name != "EXPERIMENTS":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module(f"{__name__}.registry").EXPERIMENTS
