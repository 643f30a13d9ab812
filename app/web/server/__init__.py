"""The server: its application, what runs as long as it does, and where it listens."""

from __future__ import annotations

from app.web.server.application import ROUTERS, create_app
from app.web.server.listening import bind, build_routes, serve
from app.web.server.settings import Settings

__all__ = ["ROUTERS", "Settings", "bind", "build_routes", "create_app", "serve"]
