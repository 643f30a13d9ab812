"""The clock of a camera: frame rate, start, time stamps and missing frames."""

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

STAMP, CAMERAS = "frame_time", ("cam_id", "port")
"""The columns of Caliscope's tables of time stamps: the time of a frame, seconds, and the number of
its camera, in files of earlier versions under the second name."""

_LONGEST_OFFSET = 86400.0
"""Largest time offset of a camera, seconds."""

_LATEST = 1e19
"""Largest time stamp, which may be nanoseconds since 1970."""


@dataclass(frozen=True, slots=True, eq=False)
class Clock:
    """The assignment of a camera's frames to the S steps.

    A step shows the frame that was taken nearest to it, and each frame belongs to the one step
    that is nearest to it. So a camera that is slower than the steps has no frame at some of
    them, and one that is faster has frames without a step.
    """

    frame_of_step: Int[ndarray, " S"]
    """The frame of each step; −1 for none."""
    step_of_frame: Int[ndarray, " F"]
    """The step of each frame; −1 for none. F is at least the number of frames in use."""

    @staticmethod
    def of_times(times: Float[ndarray, " F"], fps: float, steps: int) -> Clock:
        """Assign frames that were taken at given times to steps.

        Args:
            times: The time of every frame of the file since step 0, seconds; NaN for a frame that
                is not shown.
            fps: The rate of the steps, 1/s.
            steps: The number S of steps.
        """
        frames = np.flatnonzero(np.isfinite(times))
        exact = times[frames] * fps
        nearest = np.floor(exact + 0.5).astype(np.int64)
        order = np.argsort(np.abs(exact - nearest), kind="stable")
        inside = (nearest[order] >= 0) & (nearest[order] < steps)
        order = order[inside]
        filled, first = np.unique(nearest[order], return_index=True)
        frame_of_step = np.full(steps, -1, dtype=np.int64)
        frame_of_step[filled] = frames[order[first]]
        step_of_frame = np.full(len(times), -1, dtype=np.int64)
        step_of_frame[frame_of_step[filled]] = filled
        return Clock(frame_of_step, step_of_frame)

    def steps_of(self, frames: Int[ndarray, " N"]) -> Int[ndarray, " N"]:
        """Return the step of each frame of the file; −1 for none."""
        steps = np.full(len(frames), -1, dtype=np.int64)
        known = (frames >= 0) & (frames < len(self.step_of_frame))
        steps[known] = self.step_of_frame[frames[known]]
        return steps


@dataclass(frozen=True, slots=True)
class Timing:
    """The timing of a camera, as its table states it."""

    first_frame: int = 0
    """The frame of the file with which the camera begins."""
    fps: float | None = None
    """The camera's frame rate, 1/s; None if it is that of the steps."""
    time_offset: float = 0.0
    """Offset that is added to the time of every frame, seconds."""
    stamps: tuple[float, ...] | None = None
    """The time of each frame of the file, seconds, from a beginning common to all cameras."""

    @property
    def is_own(self) -> bool:
        """Whether the camera has a rate, an offset or time stamps of its own, so that the frame at
        step k may differ from ``first_frame`` + k."""
        return self.fps is not None or self.time_offset != 0.0 or self.stamps is not None

    def clock(self, fps: float, steps: int, beginning: float = 0.0) -> Clock | None:
        """Return the clock; None if step k shows frame ``first_frame`` + k.

        Frame n of the file was taken at

            (n − first_frame) / fps + time_offset,  or  stamp(n) − beginning + time_offset.

        Args:
            fps: The rate of the steps, 1/s.
            steps: The number of steps.
            beginning: The time stamp of step 0, seconds.
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

    def seconds(self, frames: int, fps: float, beginning: float) -> float:
        """Return the time from step 0 to the end of a file, seconds.

        Args:
            frames: The number of frames of the file.
            fps: The frame rate that is assumed if the camera states none, 1/s.
            beginning: The time stamp of step 0, seconds.
        """
        if self.stamps is not None:
            last = max(self.stamps[:frames], default=beginning) - beginning
            return last + self.time_offset + 1.0 / fps
        return (frames - self.first_frame) / (self.fps or fps) + self.time_offset


def read_timing(fields: Fields, folder: Path, where: str, stamps: Path | None) -> Timing:
    """Read the timing of one ``[[camera]]`` table.

    Args:
        fields: The table.
        folder: The folder of the sequence.
        where: The name of the sequence, for messages.
        stamps: The path of the file that ``timestamps`` names; None if there is none.

    Raises:
        SequenceError: If a field or the file is not valid.
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
    """Read the times of a camera's frames, seconds, ascending.

    The layout is that of Caliscope's ``frame_time_history.csv``: a row for each frame with its
    ``frame_time``, of one camera or of several, which are distinguished by ``port`` or ``cam_id``;
    the k-th row of a camera by time is frame k of its video.
    """
    columns = read_columns(
        file,
        where,
        needed=(STAMP,),
        optional=dict.fromkeys(CAMERAS, -1.0),
        largest=_LATEST,
    )
    column = next((name for name in CAMERAS if name in columns.names), CAMERAS[0])
    ports = columns.values[column]
    rows = np.ones(len(columns), dtype=bool)
    if len(np.unique(ports)) > 1:
        number = re.search(r"\d+(?=\D*$)", camera)
        rows = ports == (float(number.group()) if number else np.nan)
        if not rows.any():
            known = listed(f"{port:g}" for port in np.unique(ports))
            raise columns.error(
                int(columns.lines[0]),
                column,
                f'expected rows of camera "{camera}", whose name ends in the number of its port, '
                f"found ports {known}; name the camera after its port",
            )
    return tuple(np.sort(columns.values[STAMP][rows]).tolist())
