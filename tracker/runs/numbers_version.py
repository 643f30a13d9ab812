"""The version of the code that computes results, which is part of every cache key."""

from __future__ import annotations

import hashlib
import inspect
from functools import cache
from pathlib import Path

import cv2
import numba
import numpy as np
import scipy

from tracker import __version__
from tracker.parameters import Method, Stage
from tracker.parameters.catalogue import ORIGINS

_ROOT = Path(__file__).resolve().parents[1]

WITHOUT_EFFECT = ("corrections/log.py", "corrections/merging.py", "evaluation", "export", "library",
                  "review", "studies")  # fmt: skip
"""Prefixes of paths of code that only uses results of runs, so that a change of it changes none."""

LATER: dict[Stage, tuple[str, ...]] = {
    "single_view": ("corrections", "fusion", "smoothing", "kernels/smoothing"),
    "fusion": ("smoothing", "kernels/smoothing", "fusion/trajectories.py"),
    "smoothing": (),
    "tracks": (),
}
"""For each stage, prefixes of paths of code of later stages, which it cannot import."""


@cache
def numbers_version(stage: Stage) -> str:
    """Return a text that differs for every version of the code that may change a stage's result.

    It is made of the versions of numerical libraries and a hash of the source files and of learnt
    models, so that no version number has to be incremented by hand. Where the sources are not
    available, the version of the program alone identifies them.
    """
    left_out = tuple(str(_ROOT / name) for name in (*WITHOUT_EFFECT, *LATER[stage]))
    digest = hashlib.sha256()
    for path in sorted([*_ROOT.rglob("*.py"), *_ROOT.rglob("*.npz")]):
        if not str(path).startswith(left_out):
            digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0")
            digest.update(path.read_bytes() + b"\0")
    libraries = [np.__version__, scipy.__version__, cv2.__version__, numba.__version__]
    return " ".join([__version__, *libraries, digest.hexdigest()])


def method_version(method: Method) -> str:
    """Return the version and a hash of the source of a plugin's method; "" for one of this
    project, which :func:`numbers_version` covers."""
    origin = ORIGINS.get(method.name)
    if origin is None:
        return ""
    try:
        source = Path(inspect.getfile(method.load())).read_bytes()
    except (OSError, TypeError):
        source = b""
    return f"{origin} {hashlib.sha256(source).hexdigest()}"
