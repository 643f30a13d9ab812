"""The 3D view as a picture."""

from __future__ import annotations

from typing import Annotated

import cv2
from fastapi import APIRouter, Query, Request, Response

from app.errors import ApiError, sentence
from app.web.dependencies import ERRORS

router = APIRouter(prefix="/api/view", responses=ERRORS)


@router.get(
    "/picture.png",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}, "description": "The picture."}},
)
def picture(
    request: Request,
    width: Annotated[int, Query(ge=16, le=8192, description="Pixels.")] = 1280,
    height: Annotated[int, Query(ge=16, le=8192, description="Pixels.")] = 800,
) -> Response:
    """What the browser that came last shows in 3D, drawn once more by it."""
    room = request.app.state.room
    try:
        if room.scene is None:
            raise LookupError("the 3D view is not there")
        drawn = room.scene.picture(width, height)
    except LookupError as error:
        raise ApiError(
            409,
            "no_view",
            f"There is no picture of the 3D view: {sentence(error)}.",
            hint="Open the page in a browser and try again.",
        ) from None
    _, data = cv2.imencode(".png", drawn[..., ::-1])
    return Response(data.tobytes(), media_type="image/png", headers={"cache-control": "no-store"})
