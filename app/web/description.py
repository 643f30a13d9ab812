"""What ``/openapi.json`` says of the routes beyond what they say themselves."""

from __future__ import annotations

import re
from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute

from app.errors import PROBLEM

FAILURES = ("4XX", "5XX")
MADE_BY_THE_FRAMEWORK = "422"
"""Its own error, in another shape than ours."""

METHODS = ("get", "put", "post", "delete", "patch")


def operation_id(route: APIRoute) -> str:
    """A route's name for programs: its method and its address, such as ``get_step_step``."""
    (method,) = route.methods or ("get",)
    return "_".join([method.lower(), *re.findall(r"\w+", route.path_format)[1:]])


def install(app: FastAPI) -> None:
    """Have the description tell the truth of failures, and of who may ask."""
    describe = app.openapi

    def described() -> dict[str, Any]:
        if app.openapi_schema is None:
            _amend(describe())
        assert app.openapi_schema is not None
        return app.openapi_schema

    app.openapi = described  # type: ignore[method-assign]


def _amend(schema: dict[str, Any]) -> None:
    for path in schema["paths"].values():
        for method in METHODS:
            answers: dict[str, Any] = path.get(method, {}).get("responses", {})
            answers.pop(MADE_BY_THE_FRAMEWORK, None)
            for failure in FAILURES:
                if failure in answers:
                    problem = {"schema": {"$ref": "#/components/schemas/Problem"}}
                    answers[failure]["content"] = {PROBLEM: problem}
    components = schema["components"]
    for shape in ("HTTPValidationError", "ValidationError"):
        components["schemas"].pop(shape, None)
    components["securitySchemes"] = {
        "token": {
            "type": "http",
            "scheme": "bearer",
            "description": "The token of the printed link; its page has it as a cookie.",
        }
    }
    schema["security"] = [{"token": []}, {}]
