"""The address that takes all commands."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Body, Response
from fastapi.concurrency import run_in_threadpool

from app.errors import COMMANDS
from app.models import Model, State
from app.web.commands.corrections import CorrectionsCommand
from app.web.commands.library import Deleted, LibraryCommand
from app.web.commands.parameters import ParametersCommand
from app.web.commands.studies import StudiesCommand
from app.web.commands.teaching import TeachingCommand
from app.web.dependencies import ERRORS, Owned

AnyCommand = (
    ParametersCommand | TeachingCommand | CorrectionsCommand | LibraryCommand | StudiesCommand
)

DONE = {"description": "It is done; what has changed is told over the socket."}

router = APIRouter(responses=ERRORS)


@router.post(COMMANDS, response_model=State | Deleted, responses={204: DONE})
async def do(
    command: Annotated[AnyCommand, Body(discriminator="name")],
    owners: Owned,
) -> Model | Response:
    """Do one thing; everyone who looks is told what has changed."""
    if command.in_order:
        answer = command.apply(owners)
    else:
        answer = await run_in_threadpool(command.apply, owners)
    return Response(status_code=204) if answer is None else answer
