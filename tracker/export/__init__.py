"""Tracks, cameras and films as files: the track file and the formats of other programs."""

from tracker.export.tracks_csv import TrackFile, read_tracks_csv, save_tracks_csv, write_tracks_csv

__all__ = ["TrackFile", "read_tracks_csv", "save_tracks_csv", "write_tracks_csv"]
