"""What of the library is not as it must be, in the one shape of errors."""

from __future__ import annotations

from app.errors import ApiError, sentence
from tracker.library.errors import LibraryError, NoSuchRun


def no_library(error: LibraryError) -> ApiError:
    """The answer where the library, or the run, is not as it must be."""
    if isinstance(error, NoSuchRun):
        return ApiError(404, "no_run", f"{sentence(error)}.")
    return ApiError(409, "no_library", f"{sentence(error)}.")
