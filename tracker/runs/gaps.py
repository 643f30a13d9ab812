"""Pictures that a run did not get: how many, in which camera, and whether that was to be expected.

A video that is shorter than the recording is known from its opening. One that vanishes, is cut
off or cannot be decoded while a run reads it gives a result that looks like any other; here it
is told apart, and nothing of it is kept for later runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tracker.runs.run import Run
from tracker.sequences.pictures.frames import FrameReader

Keeping = Literal["everywhere", "in memory", "nowhere"]


@dataclass(frozen=True, slots=True)
class Gap:
    """The pictures that one camera did not give."""

    camera: str
    asked: int
    """Steps computed at which the camera's clock has a frame."""
    missing: int
    """Those of them without a picture."""
    unexpected: tuple[int, ...]
    """Steps among them that had a picture when the sequence was opened, by all that was known."""

    def __str__(self) -> str:
        return f'{self.missing} of {self.asked} pictures of camera "{self.camera}" are missing'


def gaps(run: Run) -> list[Gap]:
    """What is missing, of the cameras that miss something; nothing where no pictures are used."""
    if not run.parameters.method("single_view").used(run.parameters).pictures:
        return []
    found = []
    steps = len(run.views)
    for number, view in enumerate(run.sequence.views):
        if not view.has_pictures:
            continue
        asked = view.asked_for(steps)
        blind = np.fromiter((step[number].blind for step in run.views), bool, steps)
        missing = asked & blind
        if missing.any():
            lost = tuple(np.flatnonzero(missing & view.expected(steps)).tolist())
            found.append(
                Gap(view.camera.name, int(asked.sum()), int(missing.sum()), lost),
            )
    return found


def sentences(run: Run) -> list[str]:
    """What somebody must know of a run's pictures: a sentence each, none where all were there."""
    told = []
    for gap in gaps(run):
        lost = len(gap.unexpected)
        why = f", {lost} of them cannot be read although the file has them" if lost else ""
        told.append(f"{gap}{why}")
    changed = run.sequence.changed_files()
    if changed:
        more = f" and {len(changed) - 1} other files" if changed[1:] else ""
        told.append(
            f"{changed[0].name}{more} changed or vanished since the recording was opened: the "
            "result is not of what is there now; put it back or open the recording again"
        )
    return told


def where_to_keep(run: Run) -> Keeping:
    """Where the columns of a run that read pictures may be kept for later ones.

    Nowhere where a file changed since the sequence was opened, or a picture that could not be
    read can be read now. Where a file is as it was and its picture still cannot be read, it is
    spoilt: the columns stay for this start, and the next one looks again.
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
