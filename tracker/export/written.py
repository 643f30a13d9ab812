"""What every form is given: a run's result with what belongs to it."""

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
    """Whoever asked for it does not want it any more; nothing was written."""


def _nobody_waits(done: int, total: int) -> None:
    return


@dataclass(frozen=True, slots=True)
class Options:
    """How much is written, and who is told; only a video heeds the first three."""

    first: int = 0
    last: int | None = None
    """Both included; None for the last step that is there."""
    speed: float = 1.0
    """Of a second of the recording: 0.5 takes twice as long."""
    progress: Callable[[int, int], None] = _nobody_waits
    """Told of the steps written and their number."""
    stopped: Callable[[], bool] = lambda: False
    """Asked between steps."""

    def at(self, done: int, total: int) -> None:
        """So far.

        Raises:
            Stopped: If it is not wanted any more.
        """
        if self.stopped():
            raise Stopped
        self.progress(done, total)


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """A run's result."""

    sequence: Sequence
    tracks: Trajectories
    parameters: RunParameters
    seed: int = 0
    done: int | None = None
    """The number of steps computed; None for all."""
    remarks: tuple[str, ...] = ()
    """What must be said of it wherever it goes: that pictures were missing."""
    resting: Many[str] = ()
    """Of a corrected run the id of the correction that each row rests on, empty for none."""
    names: Mapping[int, str] = field(default_factory=dict)
    """What people were called by hand, by track."""
    back: str = ""
    """The address of the page that shows it, where there is one."""
    boxes: list[tuple[Float[ndarray, "N 4"], Bool[ndarray, " N"]]] = field(init=False)
    """For each camera left, top, width, height in pixels, and whether the picture has them."""

    def __post_init__(self) -> None:
        half = self.sequence.target_half_extents
        boxes = [c.project_boxes(self.tracks.positions, half) for c in self.sequence.cameras]
        object.__setattr__(self, "boxes", boxes)

    @property
    def steps(self) -> int:
        """How many steps are there."""
        return self.sequence.frames if self.done is None else self.done

    @property
    def ids(self) -> list[int]:
        """Of all tracks, ascending."""
        found: list[int] = np.unique(self.tracks.ids).tolist()
        return found

    @property
    def settings(self) -> dict[str, str | int | float | bool]:
        """Methods and every parameter's value, by key."""
        return {key: value(self.parameters, key) for key in (*METHODS, *PARAMETERS)}
