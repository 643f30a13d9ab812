"""The input of every export format: a run's result with its sequence and parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories
from tracker.parameters import METHODS, PARAMETERS, RunParameters, value
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
    """A callback that gets the number of steps written and of all steps."""
    stopped: Callable[[], bool] = lambda: False
    """A callback that is asked between steps whether to cancel."""

    def at(self, done: int, total: int) -> None:
        """Report progress, and stop if the caller cancelled.

        Args:
            done: The number of steps (or tracks) written.
            total: The number of all of them.

        Raises:
            Stopped: If the caller cancelled the export.
        """
        if self.stopped():
            raise Stopped
        self.progress(done, total)


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """A run's result, as it is written."""

    sequence: Sequence
    tracks: Trajectories
    parameters: RunParameters
    seed: int = 0
    done: int | None = None
    """The number of steps computed; None for all."""
    remarks: tuple[str, ...] = ()
    """Sentences that must accompany the result, for instance that pictures were missing."""
    row_corrections: Many[str] = ()
    """For a corrected run, the id of the correction that each row depends on; "" for none."""
    names: Mapping[int, str] = field(default_factory=dict)
    """The names that people were given by hand, by track id."""
    back: str = ""
    """The URL of the page that shows the run; empty if there is none."""
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
        return {key: value(self.parameters, key) for key in (*METHODS, *PARAMETERS)}
