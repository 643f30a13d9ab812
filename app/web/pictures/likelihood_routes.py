"""The route of the likelihood map, to be laid over its picture."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from app.web.api import ERRORS, FOR_EVER, Bench
from app.web.pictures.likelihood import Likelihoods, key_of, missing, shown_colours

router = APIRouter(prefix="/api", responses=ERRORS)


@router.get(
    "/likelihood/{sequence_key}/{camera}/{step}.png",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}, "description": "A pixel a cell."}},
)
def likelihood(
    request: Request,
    bench: Bench,
    sequence_key: str,
    camera: int,
    step: int,
    run: Annotated[
        str | None,
        Query(description="As the step tells it: with it the answer may be kept for ever."),
    ] = None,
) -> Response:
    """How much a person's box at each place of a picture looks like one of the templates."""
    snapshot = bench.snapshot()
    sequence = snapshot.sequence
    if sequence is None or snapshot.sequence_key != sequence_key:
        raise missing("That sequence is not open any more.", "Load the page again.")
    if not 0 <= camera < len(sequence.views) or not 0 <= step < sequence.frames:
        raise missing(
            f"There is no camera {camera} or no step {step}: {sequence.name} has "
            f"{len(sequence.views)} cameras and {sequence.frames} steps, counted from 0."
        )
    if run is not None and run != key_of(sequence, shown_colours(snapshot)):
        raise missing("The templates or colours are others by now.", "Ask for the step again.")
    maps: Likelihoods = request.app.state.likelihoods
    keep = "no-cache" if run is None else FOR_EVER
    png = maps.png(snapshot, camera, step)
    return Response(png, media_type="image/png", headers={"cache-control": keep})
