"""The route of the grid that is drawn on the floor in the pictures."""

from __future__ import annotations

from fastapi import APIRouter

from app import models
from app.web.dependencies import ERRORS, Bench, nothing_open
from app.web.views.floor import floor_of

router = APIRouter(prefix="/api", responses=ERRORS)


@router.get("/floor")
def floor(bench: Bench) -> models.Floor:
    """A grid of whole metres or half ones on the room's floor, as each camera sees it."""
    sequence = bench.snapshot().sequence
    if sequence is None:
        raise nothing_open()
    return floor_of(sequence)
