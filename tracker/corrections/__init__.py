"""Corrections by a user, as evidence that every run of a recording takes into account.

A correction is a statement about the world, by step and place, and does not refer to the ids of
a run: so it applies to any other run, after any change of parameters or method. See
:mod:`tracker.corrections.kinds` for the kinds, :mod:`tracker.corrections.log` for the file.
"""

from tracker.corrections.kinds import Correction, CorrectionError, Kind, Place

__all__ = ["Correction", "CorrectionError", "Kind", "Place"]
