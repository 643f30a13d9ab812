"""The sheet once files are there: cameras, room, checks, target, and what happens next."""

from __future__ import annotations

from app.web.importing.models import ImportInfo
from app.web.importing.sheet.building import (
    CLOSE,
    GROW,
    Markup,
    button,
    element,
    field,
    icon,
    joined,
    size_text,
)
from app.web.importing.sheet.cameras import cameras_table, ready
from app.web.importing.sheet.settings import angles_choice, checks_part, room_part, target_part
from app.web.importing.sheet.start import CALIBRATIONS


def can_be_written(info: ImportInfo) -> bool:
    """Whether a recording can be made of it."""
    pictured = all(camera.video or camera.detections for camera in info.cameras)
    return info.phase == "settled" and pictured and not info.undecided


def draft_sheet(info: ImportInfo) -> str:
    """All of it."""
    asked = angles_choice(info)
    body = [_files(info), element("div", asked, class_="in-asked") if asked else None]
    if not info.cameras and not info.busy and info.phase in ("failed", "settled"):
        body.append(_adding(info))
    if info.cameras:
        parts = (room_part(info), checks_part(info), target_part(info))
        body = [cameras_table(info), element("div", *parts, class_="in-body")]
    return joined(_head(info), *body, _foot(info)).html


def _head(info: ImportInfo) -> Markup:
    used = sum(bool(one.format) for one in info.files)
    count = len(info.files)
    facts = f"{count} file{'' if count == 1 else 's'}" if count else ""
    if info.frames:
        facts = (
            f"{len(info.cameras)} cameras · {info.fps:g} Hz · {info.frames} steps · "
            f"{info.frames / info.fps:.1f} s · {used} of {len(info.files)} files used"
        )
    add = button("Add files…", "files", "") if info.uploaded and info.phase != "uploading" else None
    return element(
        "header",
        button(icon("prev"), "give-up", "icon start", aria_label="Back to recent"),
        element("h2", "Import"),
        field("in-name", "Name", info.wish.name, {"name": "$"}, maxlength=80),
        element("span", facts, class_="sub cut", title=facts),
        GROW,
        add,
        CLOSE,
        class_="s-head",
    )


def _files(info: ImportInfo) -> Markup:
    rows = [
        element(
            "p",
            element("b", one.label),
            " ",
            one.complaint.removeprefix(f"{one.label}: ") or one.format or "is not used",
        )
        for one in info.files
    ]
    rows += [
        element("p", element("span", name, class_="cut", title=name), class_="coming")
        for name in info.coming
    ]
    return element("div", rows, class_="in-scroll in-files", tabindex=0)


def _adding(info: ImportInfo) -> Markup:
    """What may be missing where the files give no camera, and the way to add it."""
    known = f"Cameras need a calibration: {CALIBRATIONS}."
    if not info.uploaded:
        known += " Put its file into the folder and open the folder again."
    add = button("Add a calibration file…", "files", "box") if info.uploaded else None
    return element("div", element("p", known), add, class_="in-asked in-add")


def _copying(info: ImportInfo) -> str:
    if not info.copied:
        return ""
    return (
        f", {size_text(info.copied)} of {size_text(info.bytes)} copied, "
        f"{info.megabytes_per_second:.0f} MB/s"
    )


def _foot(info: ImportInfo) -> Markup:
    odd = sum(one.status == "warning" for one in info.checks)
    done = sum(ready(info, camera) for camera in info.cameras)
    odd = max(odd + bool(info.undecided), len(info.cameras) - done)
    things = f"{odd} thing{'' if odd == 1 else 's'} to decide" if odd else "nothing to decide"
    if info.busy:  # what is odd is not known yet
        things = f"looking at the {info.under_way}" if info.under_way else "looking again"
    words = {
        "uploading": "Uploading",
        "reading": info.under_way or "Reading the files",
        "writing": f"Writing the recording{_copying(info)}",
        "copying": f"It is open{_copying(info)}; until then the files are links",
    }.get(
        info.phase,
        f"{done} of {len(info.cameras)} cameras ready, {things}. Nothing is written before you "
        "import.",
    )
    kind = "busy" if info.busy or info.phase != "settled" else "warn" if odd else "good"
    if info.error:
        words, kind = info.error[:1].upper() + info.error[1:], "bad"
    uploads = info.phase == "uploading"
    moving = uploads or (info.phase in ("writing", "copying") and info.copied > 0)
    part = (info.received if uploads else info.copied) / info.bytes if info.bytes else 1.0
    bar = element(
        "span", element("i"), class_="bar", role="progressbar",
        aria_label="Upload" if uploads else "Copy",
        aria_valuemin=0, aria_valuemax=100, aria_valuenow=round(100 * min(part, 1.0)),
        style=f"--part:{min(part, 1.0):.4f}", hidden=not moving,
    )  # fmt: skip
    off = not can_be_written(info)
    stops = info.phase in ("uploading", "writing", "copying")
    return element(
        "footer",
        element("span", class_=f"dot {kind}"),
        bar,
        element("span", words, class_="cut say", role="status", title=words),
        GROW,
        button("Stop" if stops else "Cancel", "give-up", "tall"),
        button("Only import", "import", "box tall", disabled=off),
        button(joined(Markup("Import and track"), element("kbd", "Ctrl ↵")), "track", "main tall",
               disabled=off),
        class_="s-foot",
    )  # fmt: skip
