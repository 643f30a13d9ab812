"""The application that the tests of the workbench share."""

from tests.app.conftest import client, crossing, data, refusing

__all__ = ["client", "crossing", "data", "refusing"]
