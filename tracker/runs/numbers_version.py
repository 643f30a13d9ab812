"""Which code made a number: part of the key of everything that is kept between two starts."""

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
from tracker.parameters.registry import ORIGINS

_ROOT = Path(__file__).resolve().parents[1]

_NO_PART = ("corrections/log.py", "corrections/merging.py", "evaluation", "export", "library",
            "review", "studies")  # fmt: skip
"""What looks at results or makes recordings; a change of it changes no run."""

_LATER: dict[Stage, tuple[str, ...]] = {
    "single_view": ("corrections", "fusion", "smoothing", "kernels/smoothing"),
    "fusion": ("smoothing", "kernels/smoothing", "fusion/trajectories.py"),
    "smoothing": (),
    "tracks": (),
}
"""What the rule of imports keeps out of a stage: it comes after it."""


@cache
def numbers_version(stage: Stage) -> str:
    """Another text for every code that may give other numbers up to this stage.

    Made of the source files themselves and of what was learnt for them, so that nobody has to
    remember to count a number up, and of the libraries that compute. Where the sources are not
    at hand, the version of the program has to do.
    """
    left_out = tuple(str(_ROOT / name) for name in (*_NO_PART, *_LATER[stage]))
    digest = hashlib.sha256()
    for path in sorted([*_ROOT.rglob("*.py"), *_ROOT.rglob("*.npz")]):
        if not str(path).startswith(left_out):
            digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0")
            digest.update(path.read_bytes() + b"\0")
    libraries = [np.__version__, scipy.__version__, cv2.__version__, numba.__version__]
    return " ".join([__version__, *libraries, digest.hexdigest()])


def method_version(method: Method) -> str:
    """Of a method of another package its version and source; of this project's own nothing, for
    :func:`numbers_version` has them."""
    origin = ORIGINS.get(method.name)
    if origin is None:
        return ""
    try:
        source = Path(inspect.getfile(method.load())).read_bytes()
    except (OSError, TypeError):
        source = b""
    return f"{origin} {hashlib.sha256(source).hexdigest()}"
