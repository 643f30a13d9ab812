"""What the routes of studies are given: the desk, and the study that is named."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends

from app.errors import ApiError, sentence
from app.state.studies import StudyDesk
from app.web.dependencies import Owned
from tracker.sequences.errors import SequenceError
from tracker.studies.errors import StudyError
from tracker.studies.store import Store


def _desk(owners: Owned) -> StudyDesk:
    return owners.studies


Desk = Annotated[StudyDesk, Depends(_desk)]


def no_trial(error: StudyError | SequenceError, field: str) -> ApiError:
    """The answer where a study has no such trial."""
    return ApiError(404, "no_trial", f"{sentence(error)}.", field=field)


def store_of(desk: StudyDesk, name: str) -> Store:
    """The study of a name.

    Raises:
        ApiError: If there is none.
    """
    try:
        return desk.store(name)
    except StudyError as error:
        raise ApiError(404, "no_study", f"{sentence(error)}.", field="name") from None


def _study(name: str, desk: Desk) -> Store:
    return store_of(desk, name)


Named = Annotated[Store, Depends(_study)]
