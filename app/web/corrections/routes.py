"""The routes of corrections: the list, the queue, the truth."""

from __future__ import annotations

import io

from fastapi import APIRouter, Response

from app.errors import ApiError
from app.models.correcting import AlternativePreview, Corrections, DoubtQueue, GhostsRequest
from app.state.doubting import Doubting
from app.state.snapshot import Snapshot
from app.web.corrections import views
from app.web.corrections.items import alternative_of, known_item
from app.web.dependencies import ERRORS, Bench, Owned, Work, file_name, nothing_open
from tracker.corrections.truth import write_truth
from tracker.review.queue import ReviewItem

SETTLES_SECONDS = 10.0
"""So long the truth waits for the run that obeys what was just said."""

router = APIRouter(prefix="/api/corrections", responses=ERRORS)


def _open(bench: Bench) -> Snapshot:
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    return snapshot


@router.get("")
def corrections(bench: Bench, owners: Owned) -> Corrections:
    """All of them in their order, with what became of each in the shown run."""
    _open(bench)
    owners.correcting.refresh()
    return views.corrections_of(bench.snapshot(), owners.correcting)


@router.get("/queue")
def doubtful_places(bench: Bench, owners: Owned) -> DoubtQueue:
    """The doubtful places of the shown run, the most at stake first."""
    snapshot = _open(bench)
    return views.queue_of(snapshot, owners.doubting.of(snapshot), owners.correcting.skipped)


@router.get("/queue/{doubt}/{alternative}")
def preview(doubt: str, alternative: int, bench: Bench, owners: Owned) -> AlternativePreview:
    """What the tracks would be if an alternative were true: ghosts and changed lanes."""
    snapshot = _open(bench)
    found = _found(owners.doubting, snapshot, doubt)
    return views.preview_of(snapshot, found, alternative_of(found, alternative))


@router.post("/ghosts")
def ghosts(wish: GhostsRequest, bench: Bench, owners: Owned) -> AlternativePreview:
    """Have the 3D view show what the tracks would be, or that no more; what they would be."""
    snapshot = _open(bench)
    if wish.doubt is None:
        bench.show_ghosts(None)
        return AlternativePreview(tracks=[], spans=[])
    found = _found(owners.doubting, snapshot, wish.doubt)
    chosen = alternative_of(found, wish.alternative)
    told = views.preview_of(snapshot, found, chosen)
    bench.show_ghosts(views.ghosts_of(snapshot, found, chosen))
    return told


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
    write_truth(text, run.tracks, snapshot.corrections)
    name = file_name(run.sequence.name, "truth.csv")
    head = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(text.getvalue(), media_type="text/csv", headers=head)


def _found(doubts: Doubting, snapshot: Snapshot, identity: str) -> ReviewItem:
    return known_item(doubts.find(snapshot, identity), identity)
