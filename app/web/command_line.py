"""What the page shows, as the command that computes the same tracks in a terminal."""

from __future__ import annotations

import shlex
from typing import Any

from app.state.snapshot import Snapshot
from tracker.parameters.catalogue import METHODS
from tracker.parameters.values import changed_values
from tracker.sequences.built_in import opens_by_name
from tracker.sequences.sequence import Sequence


def command_line(snapshot: Snapshot) -> str:
    """The command, quoted for a POSIX shell; empty while no sequence is open.

    Both methods are named, since what fits a sequence may be another one later; of the
    values, those that are not at their defaults.
    """
    sequence, parameters = snapshot.sequence, snapshot.parameters
    if sequence is None:
        return ""
    words = ["multiview-phd", "track", _named(sequence), "-o", "tracks.csv"]
    words += ["--single-view", parameters.single_view, "--fusion", parameters.fusion_method]
    if parameters.smoothing_method != snapshot.defaults.smoothing_method:
        words += ["--smoothing", parameters.smoothing_method]
    detector = sequence.detector
    if detector is not None and detector.named and parameters.single_view == "onnx_detector":
        words += ["--detector", str(detector.path.absolute())]
    for key, value in changed_values(parameters, snapshot.defaults).items():
        if key not in METHODS:
            words += ["--set", f"{key}={_written(value)}"]
    if snapshot.run is not None and snapshot.run.seed:
        words += ["--seed", str(snapshot.run.seed)]
    return shlex.join(words)


def _named(sequence: Sequence) -> str:
    """A room by its name, anything else by its folder."""
    folder = sequence.folder.absolute()
    return folder.name if opens_by_name(folder) else str(folder)


def _written(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
