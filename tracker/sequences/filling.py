"""The estimation of what a ``sequence.toml`` does not state, from videos, boxes and views."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.consistency.observed import upright_rays
from tracker.geometry.consistency.suggestion import consensus_of_cameras, suggest
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import Fields, listed
from tracker.sequences.sequence import Room, View
from tracker.sequences.views import Source, Time

_SAME_RATE = 0.01  # largest relative difference of frame rates that count as equal
_SCORE_THRESHOLD = 0.3  # least score of a box from which room and size are estimated
_MOST_BOXES = 50_000  # most boxes of a camera from which they are estimated


def check_missing(fields: Fields, cameras: Many[Fields]) -> None:
    """Report all fields at once that are missing and cannot be estimated.

    A single missing field is reported by the function that reads it.

    Raises:
        SequenceError: If two or more fields are missing.
    """
    missing = ["name"] if "name" not in fields else []
    has_videos = any("video" in camera for camera in cameras)
    has_frames = has_videos or any("images" in c or "detections" in c for c in cameras)
    if "fps" not in fields and not has_videos:
        missing.append("fps (steps a second)")
    if "frames" not in fields and not has_frames:
        missing.append("frames (the number of steps)")
    for number, camera in enumerate(cameras, 1):
        own = [name for name in ("name",) if name not in camera]
        if "projection" not in camera:
            own += [name for name in ("K", "R", "t") if name not in camera]
        if own:
            name = f'"{camera.text("name")}"' if "name" in camera else str(number)
            missing.append(f"{listed(own)} of camera {name}")
    if len(missing) > 1:
        raise SequenceError(
            f"{fields.where}: these are missing and cannot be found out: {'; '.join(missing)}"
        )


def find_time(sources: Many[Source], fps: float | None, steps: int | None, fields: Fields) -> Time:
    """Determine the rate and the number of steps, from the file or from videos and boxes.

    If the file states no rate, it is that of the fastest video; if the videos' rates differ, each
    video is shown at its own rate.

    Args:
        sources: The files of all cameras.
        fps: The rate that the file states, steps per second; None if it states none.
        steps: The number of steps that the file states; None if it states none.
        fields: The fields of the file.

    Raises:
        SequenceError: If a value is not stated and cannot be estimated.
    """
    remarks: list[str] = []
    own_rates = False
    if fps is None:
        rates = [s.timing.fps or (s.pictures.fps if s.pictures else None) for s in sources]
        known = [rate for rate in rates if rate]
        if not known:
            fields.rate("fps")  # raises that it is missing
        fps = max(known)
        own_rates = min(known) < (1.0 - _SAME_RATE) * fps
        fastest = "fastest " if own_rates else ""
        remarks.append(f"fps is not stated: {fps:g} as the {fastest}video has")
    stamps = [s.timing.stamps[0] for s in sources if s.timing.stamps]
    beginning = min(stamps, default=0.0)
    if steps is None:
        lasting: list[float] = []
        for source in sources:
            own = source.pictures.fps if own_rates and source.pictures else None
            rate = source.timing.fps or own or fps
            if source.pictures is not None:
                lasting.append(source.timing.seconds(source.pictures.frames, rate, beginning) * fps)
            elif source.timing.stamps is not None:
                frames = len(source.timing.stamps)
                lasting.append(source.timing.seconds(frames, rate, beginning) * fps)
            elif source.table is not None:
                lasting.append(source.table.steps * fps / rate + source.timing.time_offset * fps)
        steps = int(np.floor(max(lasting, default=0.0) + 1e-6))
        if steps < 1:
            fields.integer("frames", minimum=1)  # raises that it is missing
            raise fields.error("frames", "no camera has a picture or a box after step 0")
        remarks.append(f"frames is not stated: {steps} steps, as long as the longest camera lasts")
    return Time(fps, steps, beginning, tuple(remarks), own_rates)


def find_room(
    views: Many[View],
    room: Room | None,
    half_extents: Float[ndarray, " 3"] | None,
    fields: Fields,
) -> tuple[Room, Float[ndarray, " 3"], list[str]]:
    """Estimate room and target from the places where boxes of two cameras agree or, without boxes,
    where views overlap.

    Args:
        views: The cameras.
        room: The room that the file states; None if it is to be estimated.
        half_extents: Half width, depth and height of a target that the file states, metres; None
            if they are to be estimated.
        fields: The fields of the file.

    Returns:
        The room, the half extents, and remarks on what was estimated.

    Raises:
        SequenceError: If they cannot be estimated.
    """
    cameras = [view.camera for view in views]
    agreed = None
    if sum(view.detections is not None for view in views) > 1:
        rays = []
        most = max(len(view.detections.frames) for view in views if view.detections is not None)
        every = 1 + most // _MOST_BOXES  # all cameras use the same steps
        for view in views:
            own = view.boxes_above(_SCORE_THRESHOLD, every)
            rays.append(upright_rays(own.frames, own.boxes, view.camera))
        agreed = consensus_of_cameras(cameras, rays)
    found = suggest(cameras, agreed, half_extents)
    if found is None:
        missing = "room" if room is None else "target"
        raise SequenceError(
            f"{fields.where}: table [{missing}] is missing, and neither boxes of two cameras meet "
            "nor do two views overlap, so it cannot be found out; check the calibration with "
            "multiview-phd check, or write the table"
        )
    source = "where boxes of two cameras meet" if found.people else "where two views overlap"
    remarks: list[str] = []
    if room is None:
        room = Room(found.minimum, found.maximum)
        remarks.append(
            f"[room] is not stated: {source}, from {_metres(found.minimum)} to "
            f"{_metres(found.maximum)}"
        )
    if half_extents is None:
        half_extents = found.half_extents
        what = "as tall as the boxes are" if found.people else "a standing person"
        remarks.append(f"[target] is not stated: {what}, half extents {_metres(half_extents)}")
    return room, half_extents, remarks


def _metres(vector: Float[ndarray, " 3"]) -> str:
    return "(" + ", ".join(f"{float(value):g}" for value in vector) + ") m"
