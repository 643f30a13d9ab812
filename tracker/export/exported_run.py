"""The input of every export format: a run's result with its sequence and parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import value_of
from tracker.sequences.sequence import Sequence


class Stopped(Exception):
    """The caller cancelled the export; nothing was written."""


def _ignore_progress(done: int, total: int) -> None:
    return


@dataclass(frozen=True, slots=True)
class Options:
    """The range of steps and the callbacks of an export; only a video uses the first three."""

    first: int = 0
    """The first step that is written."""
    last: int | None = None
    """The last step that is written, included; None for the last one computed."""
    speed: float = 1.0
    """The speed of playback relative to the recording: at 0.5 the video takes twice as long."""
    progress: Callable[[int, int], None] = _ignore_progress
    """A callback that gets the number of steps (or tracks) written, and the number of all."""
    stopped: Callable[[], bool] = lambda: False
    """A callback that returns whether to cancel; it is called before each step (or track)."""
    name: str = ""
    """The name that the file has once it is complete; until then it is written under another."""

    def at(self, done: int, total: int) -> None:
        """Report progress, or raise an exception if the caller cancelled.

        Args:
            done: The number of steps (or tracks) written.
            total: The number of all steps (or tracks).

        Raises:
            Stopped: If the caller cancelled the export.
        """
        if self.stopped():
            raise Stopped
        self.progress(done, total)


@dataclass(frozen=True, slots=True, eq=False)
class ExportedRun:
    """A run's result with all that an export states of it."""

    sequence: Sequence
    """The sequence that was tracked."""
    tracks: Trajectories
    """The N rows of the tracks, sorted by step and then id."""
    parameters: RunParameters
    """The parameters of the run."""
    seed: int = 0
    """The seed of the run's random numbers."""
    done: int | None = None
    """The number of steps computed; None for all."""
    remarks: tuple[str, ...] = ()
    """The sentences that accompany the result, for instance that pictures were missing."""
    row_corrections: Many[str] = ()
    """For a corrected run, the id of the correction that each row depends on, or an empty string;
    else empty."""
    names: Mapping[int, str] = field(default_factory=dict)
    """The names that the user gave to people, by track id."""
    back: str = ""
    """The URL of the page that shows the run, to which a report links; empty if there is none."""
    boxes: list[tuple[Float[ndarray, "N 4"], Bool[ndarray, " N"]]] = field(init=False)
    """For each camera the reprojected boxes of all rows (left, top, width, height in pixels), and
    whether each lies in the picture."""

    def __post_init__(self) -> None:
        half = self.sequence.target_half_extents
        boxes = [c.project_boxes(self.tracks.positions, half) for c in self.sequence.cameras]
        object.__setattr__(self, "boxes", boxes)

    @property
    def steps(self) -> int:
        """The number of steps computed."""
        return self.sequence.frames if self.done is None else self.done

    @property
    def ids(self) -> list[int]:
        """The ids of all tracks, ascending."""
        found: list[int] = np.unique(self.tracks.ids).tolist()
        return found

    @property
    def settings(self) -> dict[str, str | int | float | bool]:
        """The chosen methods and the value of every parameter, by key."""
        return {key: value_of(self.parameters, key) for key in (*METHODS, *PARAMETERS)}
