"""What a ``sequence.toml`` leaves open, found out from videos, boxes and views."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.consistency.observed import upright_rays
from tracker.geometry.consistency.suggestion import agreement, suggest
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import Fields, listed
from tracker.sequences.sequence import Room, View
from tracker.sequences.views import Source, Time

_SAME_RATE = 0.01  # share by which videos of one rate may differ
_SCORE_THRESHOLD = 0.3
_MOST_BOXES = 50_000  # of one camera, from which room and size are found out: more tell no more


def check_missing(fields: Fields, cameras: Many[Fields]) -> None:
    """Tell everything at once that is missing and that nothing in the file lets be found out.

    A single missing field is left to whoever reads it.

    Raises:
        SequenceError: If two or more are missing.
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
    """Rate and number of steps, as stated or as the videos and boxes have them.

    Without a stated rate the steps are those of the fastest video; where videos differ, each is
    shown at its own rate.

    Raises:
        SequenceError: If neither is stated and nothing tells it.
    """
    told: list[str] = []
    own_rates = False
    if fps is None:
        rates = [s.timing.fps or (s.pictures.fps if s.pictures else None) for s in sources]
        known = [rate for rate in rates if rate]
        if not known:
            fields.rate("fps")  # says what is missing
        fps = max(known)
        own_rates = min(known) < (1.0 - _SAME_RATE) * fps
        told.append(f"fps is not stated: {fps:g} as the {'fastest ' if own_rates else ''}video has")
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
            fields.integer("frames", minimum=1)  # says what is missing
            raise fields.error("frames", "no camera has a picture or a box after step 0")
        told.append(f"frames is not stated: {steps} steps, as long as the longest camera lasts")
    return Time(fps, steps, beginning, tuple(told), own_rates)


def find_room(
    views: Many[View],
    room: Room | None,
    half_extents: Float[ndarray, " 3"] | None,
    fields: Fields,
) -> tuple[Room, Float[ndarray, " 3"], list[str]]:
    """Room and target, where boxes of two cameras meet or, without boxes, where views overlap.

    Returns:
        Both, and what was found out.

    Raises:
        SequenceError: If nothing tells them.
    """
    cameras = [view.camera for view in views]
    agreed = None
    if sum(view.detections is not None for view in views) > 1:
        rays = []
        most = max(len(view.detections.frames) for view in views if view.detections is not None)
        every = 1 + most // _MOST_BOXES  # the same steps of all cameras
        for view in views:
            own = view.detections
            kept = np.zeros(0, int)
            if own is not None:
                kept = np.flatnonzero((own.scores >= _SCORE_THRESHOLD) & (own.frames % every == 0))
            frames = np.zeros(0, int) if own is None else own.frames[kept]
            boxes = np.zeros((0, 4)) if own is None else own.boxes[kept]
            rays.append(upright_rays(frames, boxes, view.camera))
        agreed = agreement(cameras, rays)
    found = suggest(cameras, agreed, half_extents)
    if found is None:
        missing = "room" if room is None else "target"
        raise SequenceError(
            f"{fields.where}: table [{missing}] is missing, and neither boxes of two cameras meet "
            "nor do two views overlap, so it cannot be found out; check the calibration with "
            "multiview-phd check, or write the table"
        )
    source = "where boxes of two cameras meet" if found.people else "where two views overlap"
    told: list[str] = []
    if room is None:
        room = Room(found.minimum, found.maximum)
        told.append(
            f"[room] is not stated: {source}, from {_metres(found.minimum)} to "
            f"{_metres(found.maximum)}"
        )
    if half_extents is None:
        half_extents = found.half_extents
        what = "as tall as the boxes are" if found.people else "a standing person"
        told.append(f"[target] is not stated: {what}, half extents {_metres(half_extents)}")
    return room, half_extents, told


def _metres(vector: Float[ndarray, " 3"]) -> str:
    return "(" + ", ".join(f"{float(value):g}" for value in vector) + ") m"
