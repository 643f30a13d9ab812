"""What the page shows, as the command that computes the same tracks in a terminal."""

from __future__ import annotations

from app.state.snapshot import Snapshot
from tracker.parameters.values import changed_values
from tracker.runs.track_command import track_command
from tracker.sequences.built_in import place_of


def command_line(snapshot: Snapshot) -> str:
    """The command, quoted for a POSIX shell; empty while no sequence is open.

    Both methods are named, since what fits a sequence may be another one later; of the
    values, those that are not at their defaults.
    """
    sequence, parameters = snapshot.sequence, snapshot.parameters
    if sequence is None:
        return ""
    methods = {"single_view": parameters.single_view, "fusion_method": parameters.fusion_method}
    changes = {**methods, **changed_values(parameters, snapshot.defaults)}
    detector = sequence.detector
    own = detector is not None and detector.named and parameters.single_view == "onnx_detector"
    network = ["--detector", str(detector.path.absolute())] if detector is not None and own else []
    seed = 0 if snapshot.run is None else snapshot.run.seed
    return track_command(place_of(sequence.folder), "tracks.csv", changes, seed, *network)
