"""Known formats that are not read: each is named in the error, with what to do instead."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from tracker.files.text import shown
from tracker.io.read.columns import delimiter_of
from tracker.io.read.pieces import FormatError
from tracker.io.read.source import NPY, ZIP, SourceFile


class _Refused(NamedTuple):
    what: str
    is_it: Callable[[SourceFile], bool]
    instead: str


def _starts(*signatures: bytes) -> Callable[[SourceFile], bool]:
    return lambda file: file.head.startswith(signatures)


def _holds(pattern: str) -> Callable[[SourceFile], bool]:
    return lambda file: re.search(pattern, file.head_text[:4096]) is not None


def _is_pickle(file: SourceFile) -> bool:
    """Whether the file begins with the opcode and number of a pickle protocol, 2 to 5."""
    return re.match(rb"\x80[\x02-\x05]", file.head) is not None


def _is_array_of_objects(file: SourceFile) -> bool:
    return file.head.startswith(NPY) and b"'|O'" in file.head[:256]


def _is_motive(file: SourceFile) -> bool:
    return "<Calibration" in file.head[:4096].decode("utf-16", errors="ignore")


def _is_dlt(file: SourceFile) -> bool:
    """Whether the file has eleven rows with a number for each camera."""
    rows = file.head_text.split()
    widths = {row.count(",") for row in rows}
    return len(rows) == 11 and len(widths) == 1 and re.search("[A-Za-df-z]", "".join(rows)) is None


_ITSELF = "reading it would run what is in it; save K, R and t as JSON or .npz, and boxes as CSV"

_KNOWN: tuple[_Refused, ...] = (
    _Refused("a Python pickle (as of DeepLabCut's 3D projects)", _is_pickle, _ITSELF),
    _Refused("a NumPy array of Python objects (a pickle)", _is_array_of_objects, _ITSELF),
    _Refused(
        "a NumPy array of another shape than cameras or boxes have",
        _starts(NPY),
        "save rows of frame, left, top, width, height, columns by name (frame, id, x, y) as .npz, "
        "or K, R and t of a camera together as .npz",
    ),
    _Refused(
        "HDF5 (as of DeepLabCut, SLEAP or MATLAB 7.3)",
        _starts(b"\x89HDF\r\n\x1a\n"),
        "save the boxes or key points as CSV, a calibration as JSON with K, R and t",
    ),
    _Refused(
        "a table of joints of DeepLabCut (or Anipose's 2D points)",
        _holds(r"\Ascorer,"),
        "save a box a row instead: frame, left, top, width, height of each animal's joints",
    ),
    _Refused(
        "a table of instances of SLEAP",
        _holds(r"\Atrack,frame_idx,instance\.score"),
        "save a box a row instead: frame, left, top, width, height of each instance's joints",
    ),
    _Refused(
        "a table of DLT coefficients (as of easyWand and Argus)",
        _is_dlt,
        "save K, R and t of each camera as JSON, or a 3×4 projection matrix a camera as text",
    ),
    _Refused(
        "a homography of the floor (as of AI City's 2019 calibrations)",
        _holds(r"(?i)\Ahomography"),
        "it does not tell how tall people are in a picture; give K and the pose, or a 3×4 matrix "
        "P, of each camera (OpenCV's solvePnP finds the pose from four points of the floor)",
    ),
    _Refused(
        "Bundler's model",
        _holds(r"\A# Bundle file"),
        "it has no sizes of pictures; export the same model for COLMAP (text) or Metashape (XML)",
    ),
    _Refused(
        "Vicon's calibration (XCP)",
        _holds(r"<Cameras[\s>](.|\n)*DEVICEID="),
        "its lens is another than OpenCV's; save K, R and t of the video cameras as JSON, or "
        "calibrate them in Pose2Sim or Caliscope",
    ),
    _Refused(
        "Motive's calibration",
        _is_motive,
        "export the cameras with Motive's API, and save K, R and t as JSON",
    ),
    _Refused(
        "Motive's take (CSV)",
        _holds(r"\AFormat Version,"),
        "export it as TRC to have it as truth",
    ),
    _Refused(
        "Supervisely's annotation of a video",
        _holds(r'"(objectKey|framesCount)"'),
        "export it as COCO or MOTChallenge",
    ),
    _Refused("C3D", _starts(*(bytes([n, 0x50]) for n in range(2, 12))), "export it as TRC"),
    _Refused("a skeleton in BVH", _holds(r"\AHIERARCHY\s"), "export the joints as TRC"),
    _Refused("FBX", _starts(b"Kaydara FBX"), "export the joints as TRC"),
    _Refused(
        "a ROS bag",
        _starts(b"#ROSBAG", b"\x89MCAP"),
        "extract pictures or video, and camera_info as YAML",
    ),
)


_ARCHIVE = _Refused(
    "an archive (ZIP, gzip, 7z, RAR or Excel's .xlsx; or a spoilt .npz)",
    _starts(ZIP, b"PK\x05\x06", b"\x1f\x8b", b"7z\xbc\xaf\x27\x1c", b"Rar!\x1a"),
    "unpack it and name the folder; save a table as CSV",
)


_WITHOUT_COMPLAINT = _holds(r"\A\s*\[Sequence\]\s")
"""Whether a file is MOTChallenge's ``seqinfo.ini``, which boxes are read with. Its first sign is
that of JSON, so that formats of JSON complain of the next."""


def refusal(file: SourceFile, complaint: FormatError | None = None) -> FormatError | None:
    """Return the error that names the format of an unreadable file and what to do; None for a file
    that no format has to read.

    Args:
        file: A file that no format reads.
        complaint: The error of a format that recognised the beginning of the file; it is returned
            if the file's format is not known here, and is preferred to its being an archive.
    """
    if _WITHOUT_COMPLAINT(file):
        return None
    for one in (*_KNOWN, _ARCHIVE) if complaint is None else _KNOWN:
        if one.is_it(file):
            return file.error(f"is {one.what}, which is not read; {one.instead}")
    names = _header(file) if complaint is None else ()
    if names:
        return file.error(
            f"is a table of {shown(', '.join(names))}, among which are neither boxes nor places; "
            'name its columns "frame", "left", "top", "width", "height" (and "camera"), or '
            '"frame", "id", "x", "y" of places on the floor'
        )
    return complaint


def _header(file: SourceFile) -> tuple[str, ...]:
    """The names of the columns of a table of numbers; none of another file."""
    lines = file.head_text.splitlines()[:2]
    delimiter = delimiter_of(lines[0]) if lines else ","
    names, cells = (
        [cell.strip() for cell in line.split(delimiter)] for line in (lines + [""] * 2)[:2]
    )
    numbers = [cell for cell in cells if re.fullmatch(r"-?\d+([.,]\d+)?(\s*%)?", cell)]
    named = len(names) > 2 and all(re.search(r"[^\W\d_]", name) for name in names)
    return (
        tuple(names) if named and len(names) == len(cells) and 2 * len(numbers) > len(cells) else ()
    )
