"""Missing pictures of a run: how many, of which camera, and whether they were expected to exist.

That a video is shorter than the recording is known when the sequence is opened. A video that
vanishes, is truncated or cannot be decoded while a run reads it would give a result that looks like
any other. This module detects it, and the columns of such a run are not cached for later runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tracker.runs.run import Run
from tracker.sequences.pictures.frames import FrameReader

Keeping = Literal["everywhere", "in memory", "nowhere"]
"""Where columns may be cached."""


@dataclass(frozen=True, slots=True)
class Gap:
    """The missing pictures of one camera."""

    camera: str
    """The name of the camera."""
    asked: int
    """The number of computed steps at which the camera's clock has a frame that the method sees."""
    missing: int
    """The number of these steps without a picture."""
    unexpected: tuple[int, ...]
    """The steps without a picture for which a picture existed when the sequence was opened."""

    def __str__(self) -> str:
        return f'{self.missing} of {self.asked} pictures of camera "{self.camera}" are missing'


def gaps(run: Run) -> list[Gap]:
    """Return the gaps of all cameras with missing pictures; none if the method uses no pictures."""
    used = run.parameters.method("single_view").used(run.parameters)
    if not used.pictures:
        return []
    found = []
    steps = len(run.views)
    seen = np.arange(steps) % used.every == 0
    for number, view in enumerate(run.sequence.views):
        if not view.has_pictures:
            continue
        asked = view.frames_due(steps) & seen
        blind = np.fromiter(run.views.values("blind", number, last=steps), bool, steps)
        missing = asked & blind
        if missing.any():
            lost = tuple(np.flatnonzero(missing & view.pictures_expected(steps)).tolist())
            found.append(
                Gap(view.camera.name, int(asked.sum()), int(missing.sum()), lost),
            )
    return found


def sentences(run: Run) -> list[str]:
    """Describe the missing pictures of a run, in a sentence for each camera and for files that
    changed; empty if nothing is missing."""
    remarks = []
    for gap in gaps(run):
        lost = len(gap.unexpected)
        why = f", {lost} of them cannot be read although the file has them" if lost else ""
        remarks.append(f"{gap}{why}")
    changed = run.sequence.changed_files()
    if changed:
        more = f" and {len(changed) - 1} other files" if changed[1:] else ""
        remarks.append(
            f"{changed[0].name}{more} changed or vanished since the recording was opened: the "
            "result is not of what is there now; put it back or open the recording again"
        )
    return remarks


def where_to_keep(run: Run) -> Keeping:
    """Decide where the columns of a run that read pictures may be cached.

    They are not cached if a file changed since the sequence was opened, or if a picture that could
    not be read can be read now. If a file is unchanged and its picture still cannot be read, the
    file is damaged: the columns are cached in memory alone, so that the program reads the file
    again when it is next started.
    """
    lost = [gap for gap in gaps(run) if gap.unexpected]
    if run.sequence.changed_files():
        return "nowhere"
    if not lost:
        return "everywhere"
    names = [camera.name for camera in run.sequence.cameras]
    with FrameReader(run.sequence, cache_bytes=0) as reader:
        for gap in lost:
            if reader.picture(names.index(gap.camera), gap.unexpected[0]) is not None:
                return "nowhere"
    return "in memory"
