"""The tables of boxes whose columns are declared.

Sources: NVIDIA DeepStream, ``deepstream_app.c``, ``write_kitti_output`` and
``write_kitti_track_output``; AI City Challenge, "Multi-camera people tracking", which has the
columns of DukeMTMC (Ristani et al., ECCV workshops 2016).
"""

from __future__ import annotations

from tracker.io.read.table_format import ZERO, TableFormat

_BOX = ("left", "top", "right", "bottom")

DEEPSTREAM = TableFormat(
    "KITTI text of DeepStream",
    ("class", *[ZERO] * 3, *_BOX, *[ZERO] * 7, "score"),
    optional=1,
    SERIES=True,
)

DEEPSTREAM_TRACKS = TableFormat(
    "KITTI text of DeepStream's tracker",
    ("class", "id", *[ZERO] * 3, *_BOX, *[ZERO] * 7, "score"),
    optional=1,
    SERIES=True,
)

AI_CITY = TableFormat(
    "NVIDIA ground truth (AI City text)",
    ("camera", "id", "frame", "left", "top", "width", "height", "x", "y"),
    unit="m",
)

FORMATS = (DEEPSTREAM, DEEPSTREAM_TRACKS, AI_CITY)
