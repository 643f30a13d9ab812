"""The one form of all errors: what failed, where, and the remedy."""

from __future__ import annotations

import errno
import http
import logging
from collections.abc import Mapping
from typing import Any, Literal

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from app.messages import Described
from tracker.corrections import CorrectionError
from tracker.library.errors import LibraryError, NoSuchRun
from tracker.parameters.catalogue import METHODS, PARAMETERS
from tracker.parameters.values import ParameterError, label_of
from tracker.studies.errors import StudyError

logger = logging.getLogger("app")

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What a system says that has no room for a file."""


class ErrorDetail(Described):
    """One failure."""

    code: str
    """A word for programs."""
    message: str
    """One sentence for people: what was expected and what was found."""
    field: str | None = None
    """The parameter, field or file that it is about."""
    hint: str | None = None
    """What to do about it."""


class Problem(Described):
    """The body of every answer that is not a success (RFC 9457)."""

    type: Literal["about:blank"]
    """That the status says which kind of failure it is, and ``code`` which one."""
    title: str
    """The status in words."""
    status: int
    """That of the answer."""
    detail: str
    """One sentence for people: what was expected and what was found."""
    code: str
    """A word for programs."""
    field: str | None
    """The parameter, field or file that it is about."""
    hint: str | None
    """What to do about it."""


PROBLEM = "application/problem+json"
"""The media type of that body."""

COMMANDS = "/api/commands"
"""The address of commands."""


REFUSED: dict[type[Exception], tuple[int, str, str | None]] = {
    CorrectionError: (422, "cannot_correct", "Nothing was changed."),
    LibraryError: (409, "no_library", None),
    NoSuchRun: (404, "no_run", None),
    StudyError: (409, "no_study", None),
}
"""Failures whose words are the engine's: status, code and hint of the answer."""


class ApiError(Exception):
    """A failure that has its words already."""

    def __init__(
        self,
        status: int,
        code: str,
        message: str,
        *,
        field: str | None = None,
        hint: str | None = None,
    ) -> None:
        super().__init__(message)
        self.status = status
        self.detail = ErrorDetail(code=code, message=message, field=field, hint=hint)


def body(status: int, detail: ErrorDetail) -> dict[str, Any]:
    """The JSON of an error."""
    problem = Problem(
        type="about:blank",
        title=http.HTTPStatus(status).phrase,
        status=status,
        detail=detail.message,
        code=detail.code,
        field=detail.field,
        hint=detail.hint,
    ).model_dump()
    # somebody else's words may have what is no text
    return {
        name: value.encode(errors="replace").decode() if isinstance(value, str) else value
        for name, value in problem.items()
    }


def _answer(
    status: int, detail: ErrorDetail, headers: Mapping[str, str] | None = None
) -> JSONResponse:
    return JSONResponse(body(status, detail), status, headers, PROBLEM)


def parameter_detail(error: ParameterError) -> ErrorDetail:
    """A parameter, by the name that a person sees, or what else was asked for, that does not exist
    or does not fit."""
    known = error.key in METHODS or error.key in PARAMETERS
    return ErrorDetail(
        code="bad_parameter",
        message=f"{label_of(error.key)}: {error.message}" if known else str(error),
        field=error.key,
        hint=error.hint or "The manual lists every parameter with its range.",
    )


def sentence(error: BaseException) -> str:
    """An exception in one line: its own words where it has some."""
    words = " ".join(str(error).split())
    if isinstance(error, OSError) and error.strerror:
        name = f"{error.filename}: " if error.filename else ""
        return f"{name}{error.strerror}"
    return words or type(error).__name__


def as_sentence(words: str) -> str:
    """Words with a full stop and a capital letter, unless they begin with a name.

    A camera, a file or a field is called as it is called: a first word that a colon or a comma
    follows, or that has anything but small letters, stays.
    """
    first = words.split(" ", 1)[0]
    plain = first.isalpha() and first.islower()
    return f"{words[:1].upper() if plain else words[:1]}{words[1:]}."


def install(app: FastAPI) -> None:
    """Make every failure of the application answer in the one shape."""

    @app.exception_handler(ApiError)
    async def _api(_: Request, error: ApiError) -> JSONResponse:
        return _answer(error.status, error.detail)

    @app.exception_handler(ParameterError)
    async def _parameter(_: Request, error: ParameterError) -> JSONResponse:
        return _answer(422, parameter_detail(error))

    async def _refused(_: Request, error: Exception) -> JSONResponse:
        status, code, hint = next(REFUSED[kind] for kind in type(error).__mro__ if kind in REFUSED)
        return _answer(
            status, ErrorDetail(code=code, message=as_sentence(sentence(error)), hint=hint)
        )

    for kind in REFUSED:
        app.add_exception_handler(kind, _refused)

    @app.exception_handler(RequestValidationError)
    async def _request(request: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        if first["type"] == "json_invalid":
            why, byte = first["ctx"]["error"], first["loc"][1]
            detail = ErrorDetail(
                code="bad_request",
                message=f"The body is not JSON: {why}, at byte {byte}.",
                hint='Send an object such as {"name": "set_parameters", "changes": {}}.',
            )
            return _answer(422, detail)
        place = [str(part) for part in first["loc"]]
        if first["type"].startswith("union_tag"):
            place += ["name"]
        elif request.url.path == COMMANDS:
            place[1:2] = []  # the command that is asked for
        field = ".".join(place[1:]) or place[0]
        detail = ErrorDetail(
            code="bad_request",
            message=f"{field}: {first['msg'][:1].lower()}{first['msg'][1:]}",
            field=field,
            hint="See /docs for what this address takes.",
        )
        return _answer(422, detail)

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> JSONResponse:
        if error.status_code == 404:
            detail = ErrorDetail(
                code="not_found",
                message=f"There is nothing at {request.url.path}.",
                hint="See /docs for what there is.",
            )
        elif error.status_code == 405:
            detail = ErrorDetail(
                code="method_not_allowed",
                message=f"{request.url.path} does not take {request.method}.",
                hint="See /docs for what it takes.",
            )
        else:
            code = "too_large" if error.status_code == 413 else "http_error"
            detail = ErrorDetail(code=code, message=str(error.detail))
        return _answer(error.status_code, detail, error.headers)

    @app.exception_handler(OSError)
    async def _system(request: Request, error: OSError) -> JSONResponse | None:
        if request.scope["type"] == "websocket":
            return None  # whoever was connected has left, and takes no answer
        if error.errno not in FULL:
            return await _unexpected(request, error)
        detail = ErrorDetail(
            code="disk_full",
            message=f"There is no space left: {sentence(error)}.",
            hint="Nothing was changed; free some space and do it again.",
        )
        return _answer(507, detail)

    @app.exception_handler(Exception)
    async def _unexpected(request: Request, error: Exception) -> JSONResponse:
        logger.error("%s %s failed", request.method, request.url.path, exc_info=error)
        detail = ErrorDetail(
            code="internal",
            message=f"The server failed: {type(error).__name__}: {sentence(error)}",
            hint="The terminal shows where; what was open still is.",
        )
        return _answer(500, detail)
