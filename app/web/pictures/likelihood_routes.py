"""The route of the likelihood map, to be laid over its picture."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from app.web.dependencies import ERRORS, Bench
from app.web.pictures.address import Kept, checked, picture_of, png
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
    run: Kept = None,
) -> Response:
    """How much a person's box at each place of a picture looks like one of the templates."""
    snapshot = bench.snapshot()
    sequence, reader = checked(snapshot, sequence_key, camera, step, missing)
    picture = picture_of(sequence, reader, camera, step, missing)
    if run is not None and run != key_of(sequence, shown_colours(snapshot)):
        raise missing("The templates or colours are others by now.", "Ask for the step again.")
    maps: Likelihoods = request.app.state.likelihoods
    return png(maps.png(sequence, reader, shown_colours(snapshot), camera, picture), run)
