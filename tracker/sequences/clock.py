"""When a camera took which of its frames: other rates, late starts, time stamps, missing frames."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.sequences.csv_columns import read_columns
from tracker.sequences.fields import Fields, listed

FIELDS = ("fps", "time_offset", "timestamps")
"""The fields of a camera that give it a clock of its own."""

_LONGEST_OFFSET = 86400.0

_LATEST = 1e19
"""Of a time stamp: some count from 1970, in nanoseconds."""


@dataclass(frozen=True, slots=True, eq=False)
class Clock:
    """Which frame of its file a camera shows at each of S steps.

    A step shows the frame that was taken nearest to it, and each frame belongs to the one step
    that is nearest to it: so a camera that is slower than the steps shows nothing at some of
    them, and one that is faster leaves frames out.
    """

    frame_of_step: Int[ndarray, " S"]
    """-1 where the camera has no frame."""
    step_of_frame: Int[ndarray, " F"]
    """-1 where a frame belongs to no step. F frames, those of the file or as many as needed."""

    @staticmethod
    def of_times(times: Float[ndarray, " F"], fps: float, steps: int) -> Clock:
        """The clock of a camera that took its frames at these times.

        Args:
            times: Seconds since step 0, of every frame of the file; NaN for one that is not to
                be shown.
            fps: Of the steps.
            steps: S.
        """
        frames = np.flatnonzero(np.isfinite(times))
        exact = times[frames] * fps
        nearest = np.floor(exact + 0.5).astype(np.int64)
        order = np.argsort(np.abs(exact - nearest), kind="stable")
        inside = (nearest[order] >= 0) & (nearest[order] < steps)
        order = order[inside]
        taken, first = np.unique(nearest[order], return_index=True)
        frame_of_step = np.full(steps, -1, dtype=np.int64)
        frame_of_step[taken] = frames[order[first]]
        step_of_frame = np.full(len(times), -1, dtype=np.int64)
        step_of_frame[frame_of_step[taken]] = taken
        return Clock(frame_of_step, step_of_frame)

    def steps_of(self, frames: Int[ndarray, " N"]) -> Int[ndarray, " N"]:
        """The step of each frame of the file, -1 where it belongs to none."""
        steps = np.full(len(frames), -1, dtype=np.int64)
        known = (frames >= 0) & (frames < len(self.step_of_frame))
        steps[known] = self.step_of_frame[frames[known]]
        return steps


@dataclass(frozen=True, slots=True)
class Timing:
    """What a camera's table says of its clock."""

    first_frame: int = 0
    fps: float | None = None
    """Of the camera, None for that of the steps."""
    time_offset: float = 0.0
    """Seconds that are added to the time of every frame."""
    stamps: tuple[float, ...] | None = None
    """Seconds, one each frame of the file, from a beginning that all cameras share."""

    @property
    def is_own(self) -> bool:
        """Whether it is not simply frame ``first_frame`` + k at step k."""
        return self.fps is not None or self.time_offset != 0.0 or self.stamps is not None

    def clock(self, fps: float, steps: int, beginning: float = 0.0) -> Clock | None:
        """Which frame belongs to which step; None where it is frame ``first_frame`` + k.

        Frame n of the file was taken at

            (n − first_frame) / fps + time_offset,  or  stamp(n) − beginning + time_offset.

        Args:
            fps: Of the steps.
            steps: How many there are.
            beginning: The time stamp of step 0.
        """
        if not self.is_own:
            return None
        if self.stamps is not None:
            times = np.array(self.stamps, dtype=float) - beginning
            times[: self.first_frame] = np.nan
        else:
            own = self.fps or fps
            reach = (steps / fps - self.time_offset) * own
            count = max(0, int(np.ceil(reach)) + 2) + self.first_frame
            times = (np.arange(count) - self.first_frame) / own
        return Clock.of_times(times + self.time_offset, fps, steps)

    def seconds(self, frames: int, fps: float, beginning: float = 0.0) -> float:
        """How long a file of so many frames lasts after step 0."""
        if self.stamps is not None:
            last = max(self.stamps[:frames], default=beginning) - beginning
            return last + self.time_offset + 1.0 / fps
        return (frames - self.first_frame) / (self.fps or fps) + self.time_offset


def read_timing(fields: Fields, folder: Path, where: str, stamps: Path | None) -> Timing:
    """The clock of one ``[[camera]]`` table.

    Args:
        fields: The table.
        folder: Of the sequence.
        where: The sequence, as messages begin.
        stamps: The file that ``timestamps`` names, found.

    Raises:
        SequenceError: If something in it is wrong.
    """
    timing = Timing(
        first_frame=fields.integer("first_frame", 0),
        fps=fields.rate("fps") if "fps" in fields else None,
        time_offset=fields.number("time_offset", above=-_LONGEST_OFFSET, at_most=_LONGEST_OFFSET)
        if "time_offset" in fields
        else 0.0,
    )
    if stamps is None:
        return timing
    if timing.fps is not None:
        raise fields.error("fps", "stands in place of timestamps; remove one or the other")
    name = fields.text("name")
    path = f"{where}/{stamps.relative_to(folder).as_posix()}"
    return Timing(timing.first_frame, None, timing.time_offset, _stamps(stamps, path, name))


def _stamps(file: Path, where: str, camera: str) -> tuple[float, ...]:
    """The times of a camera's frames, seconds, in their order.

    The layout is that of Caliscope's ``frame_time_history.csv``: a row a frame with its
    ``frame_time``, of one camera or of several, which are told apart by ``port`` or ``cam_id``;
    the k-th row of a camera by time is frame k of its video.
    """
    columns = read_columns(
        file,
        where,
        needed=("frame_time",),
        optional={"port": -1.0, "cam_id": -1.0},
        largest=_LATEST,
    )
    ports = columns.values["port" if "port" in columns.names else "cam_id"]
    rows = np.ones(len(columns), dtype=bool)
    if len(np.unique(ports)) > 1:
        number = re.search(r"\d+(?=\D*$)", camera)
        rows = ports == (float(number.group()) if number else np.nan)
        if not rows.any():
            known = listed(f"{port:g}" for port in np.unique(ports))
            raise columns.error(
                int(columns.lines[0]),
                "port" if "port" in columns.names else "cam_id",
                f'expected rows of camera "{camera}", whose name ends in the number of its port, '
                f"found ports {known}; name the camera after its port",
            )
    return tuple(np.sort(columns.values["frame_time"][rows]).tolist())
