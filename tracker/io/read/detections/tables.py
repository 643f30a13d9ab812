"""The tables of boxes whose columns are declared.

Sources: NVIDIA DeepStream, ``deepstream_app.c``, ``write_kitti_output`` and
``write_kitti_track_output``; KITTI's development kit for tracking (Geiger et al., CVPR 2012);
VATIC's text (Vondrick et al., IJCV 101, 2013), which the CAMPUS data set has (Xu et al., CVPR
2016); AI City Challenge, "Multi-camera people tracking", which has the columns of DukeMTMC (Ristani
et al., ECCV workshops 2016).
"""

from __future__ import annotations

from tracker.io.read.table_format import LOST, ZERO, TableFormat

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

KITTI_TRACKING = TableFormat(
    "KITTI tracking labels",
    ("frame", "id", "class", *[""] * 3, *_BOX, *[""] * 7, "score"),
    optional=1,
)

VATIC = TableFormat("VATIC text", ("id", *_BOX, "frame", LOST, "", "", "class"))

AI_CITY = TableFormat(
    "NVIDIA ground truth (AI City text)",
    ("camera", "id", "frame", "left", "top", "width", "height", "x", "y"),
    unit="m",
)

FORMATS = (DEEPSTREAM, DEEPSTREAM_TRACKS, KITTI_TRACKING, VATIC, AI_CITY)
