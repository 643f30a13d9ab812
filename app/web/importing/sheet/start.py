"""The sheet before anything was dropped: files, what was open last, the built-in rooms."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from app.state.importing.uploads import MOST_BYTES
from app.web.importing.models import RecordingCard, Recordings
from app.web.importing.sheet.building import (
    CLOSE,
    GROW,
    Markup,
    button,
    element,
    heading,
    icon,
    joined,
    size_text,
    small,
)

CALIBRATIONS = (
    "OpenCV, Pose2Sim, Caliscope, Anipose, Qualisys, COLMAP, Metashape, Kalibr, ROS, projections"
)
UNDERSTOOD = (
    ("Video", "mp4, mov, avi, mkv; folders of numbered pictures"),
    ("Calibration", CALIBRATIONS),
    (
        "Detections",
        "MOTChallenge, YOLO, COCO, OpenPose, CVAT, LabelMe, VIA, JSON, CSV; none is fine too",
    ),
)
DAY = 86400.0


def start_sheet(known: Recordings, open_as: Sequence[str]) -> str:
    """All of it.

    Args:
        known: What can be opened.
        open_as: Names and folders of what is open.
    """
    head = element(
        "header",
        element("h2", "Open a recording"),
        GROW,
        element(
            "input", id="open-find", type="search", placeholder="find by name",
            aria_label="Find by name",
        ),
        CLOSE,
        class_="s-head",
    )  # fmt: skip
    body = element("div", _files(known), _lists(known, open_as), class_="open-body")
    return joined(head, body).html


def _files(known: Recordings) -> Markup:
    drop = element(
        "div",
        icon("import", "l"),
        element("b", "Drop files or a folder"),
        element(
            "p",
            "Videos or picture folders, a calibration, detections: whatever there is. "
            f"At most {MOST_BYTES >> 30} GB; {size_text(known.free)} are free.",
        ),
        element(
            "span",
            button("Choose files…", "files"),
            button("Choose folder…", "folder"),
            class_="group",
        ),
        class_="dropzone",
    )
    place = element(
        "form",
        element(
            "input", id="open-path", type="text", placeholder="folder or sequence.toml",
            aria_label="Path", list="open-folders", autocomplete="off",
        ),
        element("datalist", [element("option", value=f) for f in known.folders], id="open-folders"),
        button("Open", "path"),
        class_="pathline",
    )  # fmt: skip
    rows = [m for w, text in UNDERSTOOD for m in (element("dt", w), element("dd", text))]
    return element(
        "section",
        drop,
        element("label", "or a path on the machine that runs the workbench", for_="open-path",
                class_="small"),
        place,
        element("dl", rows, class_="known"),
        class_="open-files",
        aria_label="Files",
    )  # fmt: skip


def _lists(known: Recordings, open_as: Sequence[str]) -> Markup:
    own = [card for card in known.recordings if card.kind != "rendered"]
    rooms = [card for card in known.recordings if card.kind == "rendered"]
    return element(
        "section",
        _cards(
            "Recent",
            "" if own else "what you open is found here again",
            own,
            open_as,
            GROW,
            button("All in the library", "library", ""),
        ),
        _cards(
            "Built-in rooms",
            "they come with the program, with truth",
            rooms,
            open_as,
        ),
        class_="open-list",
        aria_label="Recordings",
    )


def _cards(
    words: str,
    note: str,
    cards: Sequence[RecordingCard],
    open_as: Sequence[str],
    *beside: Markup,
) -> Markup:
    names = Counter(card.name for card in cards)
    found = element(
        "div", [_card(card, open_as, named=names[card.name] == 1) for card in cards], class_="cards"
    )
    return joined(heading(words, small(note), *beside), found)


def _card(card: RecordingCard, open_as: Sequence[str], *, named: bool) -> Markup:
    """A recording; its folder is told with it where ``named`` says that its name is not enough."""
    is_open = card.opens in open_as
    length = (
        f"{card.fps:g} Hz · {_duration(card.frames / card.fps)}"
        if card.fps
        else card.description.removeprefix("rendered room: ")
        or (f"{card.frames} steps" if card.frames else "")
    )
    cameras = f"{card.cameras} camera{'s' if card.cameras > 1 else ''}"
    # under its picture; what was opened and has none has boxes alone
    sign = "boxes" if card.opened else "folder"
    blank = element("span", icon(sign, "l"), class_="blank")
    picture = element("img", src=card.picture, alt="", loading="lazy") if card.picture else None
    return element(
        "button",
        element("span", blank, picture, small(cameras, class_="lens"), class_="shot"),
        element("b", card.name),
        None if named else small("…/" + "/".join(Path(card.opens).parts[-2:])),
        element(
            "span",
            element("span", length, class_="cut"),
            element("span", "open now" if is_open else _ago(card.opened)),
            class_="small",
        ),
        class_="rec",
        title=f"{card.name}: {card.description or length}" + ("" if named else f", {card.opens}"),
        data_do="recording",
        data_value=card.opens,
        aria_current="true" if is_open else None,
    )


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.1f} s"


def _ago(opened: float) -> str:
    if not opened:
        return ""
    days = max(0, int((time.time() - opened) // DAY))  # a clock may have gone back
    return ("today", "yesterday")[days] if days < 2 else f"{days} days ago"
