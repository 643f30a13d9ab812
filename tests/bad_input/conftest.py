"""The application that wrong requests and files are sent to."""

from tests.app.conftest import client, crossing, data, run, shared

__all__ = ["client", "crossing", "data", "run", "shared"]
