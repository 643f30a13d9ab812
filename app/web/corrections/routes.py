"""The routes of corrections: the list, the queue, answers."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response

from app.errors import ApiError, as_sentence
from app.models.correcting import (
    AlternativePreview,
    AnswerRequest,
    Corrections,
    CorrectionsRequest,
    DoubtQueue,
    GhostsRequest,
    SkipRequest,
)
from app.state.correcting import Correcting
from app.state.doubting import Doubting
from app.state.snapshot import Snapshot
from app.web.corrections import views
from app.web.corrections.wishes import corrections_of
from app.web.dependencies import ERRORS, Bench, Work, file_name, nothing_open
from tracker.corrections import CorrectionError
from tracker.corrections.truth import write_truth
from tracker.review.queue import ReviewItem
from tracker.review.queue.item import confirm

NOTHING_CHANGED = "Nothing was changed."
SETTLES_SECONDS = 10.0
"""So long the truth waits for the run that obeys what was just said."""

router = APIRouter(prefix="/api/corrections", responses=ERRORS)


def _correcting(request: Request) -> Correcting:
    correcting: Correcting = request.app.state.correcting
    return correcting


def _doubting(request: Request) -> Doubting:
    doubting: Doubting = request.app.state.doubting
    return doubting


Correct = Annotated[Correcting, Depends(_correcting)]
Doubts = Annotated[Doubting, Depends(_doubting)]


@contextmanager
def _complaining(status: int = 422) -> Iterator[None]:
    """What cannot be, in the one shape of errors."""
    try:
        yield
    except CorrectionError as error:
        words = as_sentence(str(error))
        raise ApiError(status, "cannot_correct", words, hint=NOTHING_CHANGED) from None


def _open(bench: Bench) -> Snapshot:
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    return snapshot


@router.get("")
def corrections(bench: Bench, correct: Correct) -> Corrections:
    """All of them in their order, with what became of each in the shown run."""
    _open(bench)
    correct.refresh()
    return views.corrections_of(bench.snapshot(), correct)


@router.post("")
def add_corrections(wish: CorrectionsRequest, bench: Bench, correct: Correct) -> Corrections:
    """Say some things at once; the run follows at once."""
    snapshot = _open(bench)
    with _complaining():
        correct.add(
            [one for part in wish.corrections for one in corrections_of(part, snapshot, wish.note)]
        )
    return views.corrections_of(bench.snapshot(), correct)


@router.get("/queue")
def doubtful_places(bench: Bench, correct: Correct, doubts: Doubts) -> DoubtQueue:
    """The doubtful places of the shown run, the most at stake first."""
    snapshot = _open(bench)
    return views.queue_of(snapshot, doubts.of(snapshot), correct.skipped)


@router.get("/queue/{doubt}/{alternative}")
def preview(doubt: str, alternative: int, bench: Bench, doubts: Doubts) -> AlternativePreview:
    """What the tracks would be if an alternative were true: ghosts and changed lanes."""
    snapshot = _open(bench)
    found = _found(doubts, snapshot, doubt)
    return views.preview_of(snapshot, found, _alternative(found, alternative))


@router.post("/ghosts")
def ghosts(wish: GhostsRequest, bench: Bench, doubts: Doubts) -> AlternativePreview:
    """Have the 3D view show what the tracks would be, or that no more; what they would be."""
    snapshot = _open(bench)
    if wish.doubt is None:
        bench.show_ghosts(None)
        return AlternativePreview(tracks=[], spans=[])
    found = _found(doubts, snapshot, wish.doubt)
    chosen = _alternative(found, wish.alternative)
    told = views.preview_of(snapshot, found, chosen)
    bench.show_ghosts(views.ghosts_of(snapshot, found, chosen))
    return told


@router.post("/answers")
def answer(wish: AnswerRequest, bench: Bench, correct: Correct, doubts: Doubts) -> Corrections:
    """Say what is true of a doubtful place, of the shown run or of one before it; that it is as
    it is, is kept too."""
    snapshot = _open(bench)
    found = _there(doubts.told(snapshot, wish.doubt), wish.doubt)
    chosen = found.alternatives[_alternative(found, wish.alternative)]
    if not chosen.corrections:
        correct.skipped.add(found.id)
        return views.corrections_of(snapshot, correct)
    with _complaining():
        correct.add(confirm(chosen.corrections, found.title if wish.alternative else ""))
    return views.corrections_of(bench.snapshot(), correct)


@router.post("/skips")
def skip(wish: SkipRequest, bench: Bench, correct: Correct, doubts: Doubts) -> DoubtQueue:
    """Pass over a doubtful place until the program ends."""
    snapshot = _open(bench)
    correct.skipped.add(wish.doubt)
    return views.queue_of(snapshot, doubts.of(snapshot), correct.skipped)


@router.get("/truth.csv", response_class=Response)
def truth(bench: Bench, work: Work) -> Response:
    """The corrected tracks of the checked steps, as a truth that `evaluate` reads."""
    _open(bench)
    snapshot = work.settled(SETTLES_SECONDS)
    run = snapshot.run
    if run is None or not run.complete or snapshot.run_state.state == "computing":
        raise ApiError(
            409, "no_run", "The run is not finished.", hint="Wait until it is, then ask again."
        )
    text = io.StringIO(newline="")
    with _complaining(409):
        write_truth(text, run.tracks, snapshot.corrections)
    name = file_name(run.sequence.name, "truth.csv")
    head = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(text.getvalue(), media_type="text/csv", headers=head)


@router.delete("/{correction}")
def remove(correction: str, bench: Bench, correct: Correct) -> Corrections:
    """Take one out, wherever it stands; it can be undone as any edit."""
    _open(bench)
    with _complaining(404):
        correct.remove(correction)
    return views.corrections_of(bench.snapshot(), correct)


def _found(doubts: Doubting, snapshot: Snapshot, identity: str) -> ReviewItem:
    return _there(doubts.find(snapshot, identity), identity)


def _there(found: ReviewItem | None, identity: str) -> ReviewItem:
    if found is None:
        raise ApiError(
            404, "no_doubt", f"There is no doubtful place {identity} any more.",
            hint="The list of places to check has those of the shown run.",
        )  # fmt: skip
    return found


def _alternative(doubt: ReviewItem, number: int) -> int:
    if not 0 <= number < len(doubt.alternatives):
        raise ApiError(
            404, "no_alternative", f"Expected an alternative below {len(doubt.alternatives)}, "
            f"got {number}.", hint="0 is as it is.",
        )  # fmt: skip
    return number
