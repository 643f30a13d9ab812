"""What a person put right: corrections as evidence that every run of a recording obeys.

A correction says something of the world, by step and place, and nothing of one run's numbers:
so it holds for any other run, after any change of values or method. See
:mod:`tracker.corrections.kinds` for what there is, :mod:`tracker.corrections.log` for the file.
"""

from tracker.corrections.kinds import Correction, CorrectionError, Kind, Place

__all__ = ["Correction", "CorrectionError", "Kind", "Place"]
