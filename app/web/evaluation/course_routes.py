"""The HTTP routes of what can be plotted of a track."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from app import models
from app.errors import ApiError
from app.web.dependencies import ERRORS, Bench, Part, nothing_open
from app.web.views import courses

router = APIRouter(prefix="/api/courses", responses=ERRORS)


@router.get("/kinds")
def kinds() -> models.CourseKinds:
    """What can be plotted of a track."""
    return courses.kinds_told()


@router.get("/{track}")
def of_track(
    track: int,
    bench: Bench,
    part: Part,
    kind: Annotated[list[str] | None, Query(description="Which; all where none is named.")] = None,
) -> models.Courses:
    """Something of one track of the shown run over time, at the width that it is drawn at."""
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    if snapshot.run is None:
        raise ApiError(409, "nothing_computed", "There are no tracks yet.")
    names = list(courses.KINDS) if kind is None else kind
    window = part.window(snapshot.sequence.frames)
    return courses.courses_of(snapshot.run, snapshot.scores.shown, track, names, window)
