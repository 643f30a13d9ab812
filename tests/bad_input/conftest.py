"""The application that wrong requests and files are sent to."""

from tests.app.conftest import client, crossing, data, refusing, run

__all__ = ["client", "crossing", "data", "refusing", "run"]
