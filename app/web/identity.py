"""The HTTP routes of the check of identities without truth: begun, watched, stopped."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter

from app.errors import ApiError
from app.messages import Model, filled
from app.state.tasks import Checked, IdentityCheck
from app.web.dependencies import ERRORS, Bench, of_app, opened
from tracker.review.self_consistency.estimate import WARNING

router = APIRouter(prefix="/api/identity", responses=ERRORS)


class Witness(Model):
    """What leaving one camera out says."""

    camera: str
    agreed: float
    """IDF1 of the others alone by all of them."""
    overlap: float | None
    """Mean overlap of its boxes with the people whom the others found; null without both."""


class Disagreement(Model):
    """A moment at which other ways to look disagree."""

    step: int
    ids: list[int]
    why: str


class IdentityInfo(Model):
    """How well people are told apart, as far as the recording alone can say."""

    run: str
    """Key of the run that was looked at; empty before the first time."""
    state: Literal["idle", "looking", "done", "failed", "cancelled"]
    done: int
    total: int
    """Steps over all ways to look; 0 while it is not known."""
    error: str | None
    score: float | None
    """Estimate of IDF1; null until it is done, as all that follows."""
    low: float | None
    high: float | None
    """IDF1 lay between these in nine of ten runs by which the estimate was calibrated."""
    backwards: float | None
    """IDF1 of the run backwards in time by the run as it is."""
    witnesses: list[Witness]
    """Empty where there is one camera only."""
    doubts: list[Disagreement]
    """The most doubtful first."""
    warning: str


Check = Annotated[IdentityCheck, of_app("identity_check")]


@router.get("")
def identity(check: Check, bench: Bench) -> IdentityInfo:
    """How far the check is, and what it found."""
    return _info(check.now, bench)


@router.post("")
def begin(check: Check, bench: Bench) -> IdentityInfo:
    """Look at the shown run's recording backwards and without each camera."""
    now, _ = opened(bench)
    try:
        if now.run is None:
            raise ValueError("no step is there")
        return _info(check.start(now.run), bench)
    except ValueError as error:
        raise ApiError(
            409,
            "not_finished",
            f"Identities are checked of a run that was computed to its end: {error}.",
            hint="Wait for its end, or compute it again.",
        ) from None


@router.delete("")
def stop(check: Check, bench: Bench) -> IdentityInfo:
    """Stop looking."""
    check.cancel()
    return _info(check.now, bench)


def _info(now: Checked, bench: Bench) -> IdentityInfo:
    found, sequence = now.found, bench.snapshot().sequence
    names = [] if sequence is None else [camera.name for camera in sequence.cameras]
    low, high = (None, None) if found is None else found.interval
    return filled(
        IdentityInfo,
        now,
        score=None if found is None else found.score,
        low=low,
        high=high,
        backwards=None if found is None else found.backwards,
        witnesses=[
            Witness(camera=name, agreed=agreed, overlap=overlap)
            for name, agreed, overlap in zip(names, found.without, found.overlaps, strict=False)
        ]
        if found is not None
        else [],
        doubts=[
            Disagreement(step=doubt.step, ids=list(doubt.ids), why=doubt.why)
            for doubt in (() if found is None else found.disagreements)
        ],
        warning=WARNING,
    )
