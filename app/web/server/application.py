"""The application: its routes, the page's files, and who may ask for them."""

from __future__ import annotations

from fastapi import FastAPI, Request
from fastapi.responses import Response
from fastapi.staticfiles import StaticFiles
from fastapi_offline import FastAPIOffline
from starlette.types import Scope

from app import errors
from app.paths import static_folder
from app.web import api, description, stream, teaching_routes
from app.web.access import gateway
from app.web.access.security import CONTENT_POLICY, Guard, OnlyLooking, allowed_hosts, is_loopback
from app.web.access.tokens import Access
from app.web.commands import routes as commands
from app.web.corrections import routes as corrections
from app.web.evaluation import course_routes, identity_routes
from app.web.evaluation import routes as evaluation
from app.web.importing import routes as importing
from app.web.library import export_routes
from app.web.library import routes as library
from app.web.manual import Manual
from app.web.pictures import floor_routes, foreground, likelihood_routes, view_routes
from app.web.server.running import lifespan
from app.web.server.settings import Settings
from app.web.studies import result_routes as study_results
from app.web.studies import routes as studies
from tracker import __version__
from tracker.library.records import Result

ROUTERS = (
    api.router,
    commands.router,
    foreground.router,
    likelihood_routes.router,
    floor_routes.router,
    view_routes.router,
    teaching_routes.router,
    corrections.router,
    evaluation.router,
    identity_routes.router,
    course_routes.router,
    importing.router,
    library.router,
    export_routes.router,
    studies.router,
    study_results.router,
    stream.router,
    gateway.router,
)
"""What is served, the page's files apart; the page's types are made from their answers."""

ASK_AGAIN = "no-cache"
"""The page's files are kept by the browser but checked by their ETag each time."""

ICON, A_DAY = "icon.svg", "max-age=86400"
"""The icon is not checked for a day: browsers want it again with every change of the address."""


def create_app(settings: Settings) -> FastAPI:
    """The whole application; it owns threads from its start to its end."""
    app: FastAPI = FastAPIOffline(
        title="multiview-phd",
        version=__version__,
        description="Tracks of several people in 3D from calibrated cameras, and their tuning.",
        redoc_url=None,
        static_url="/docs-files",  # the page of the routes loads nothing from another host
        generate_unique_id_function=description.operation_id,
        lifespan=lifespan,
    )
    description.install(app)
    app.state.settings = settings
    if isinstance(settings.run, Result):
        app.add_middleware(OnlyLooking)
    app.add_middleware(Access, keys=settings.keys)
    app.add_middleware(  # the last one is the first that sees a request
        Guard,
        hosts=allowed_hosts(settings.host),
        addresses_are_fine=not is_loopback(settings.host),
    )
    errors.install(app)
    for router in ROUTERS:
        app.include_router(router)
    files = _PageFiles(directory=static_folder())

    @app.get("/", include_in_schema=False)
    async def page(request: Request) -> Response:
        response = await files.get_response("index.html", request.scope)
        response.headers["content-security-policy"] = CONTENT_POLICY
        return response

    app.mount("/static", files, name="static")
    app.mount("/manual", Manual(), name="manual")
    return app


class _PageFiles(StaticFiles):
    """The page's files with an ETag, checked each time: an update shows at once."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = A_DAY if path == ICON else ASK_AGAIN
        return response
