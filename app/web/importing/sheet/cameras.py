"""The cameras of an import: a row each, with all that belongs to one and what is odd about it."""

from __future__ import annotations

from urllib.parse import quote

from app.web.importing.models import ImportedCamera, ImportInfo
from app.web.importing.sheet.building import (
    Cell,
    Markup,
    element,
    field,
    icon,
    joined,
    number_field,
    select,
    small,
    wishing,
)
from app.web.importing.sheet.drawing import curve_picture

HEADS = ("Camera", "Video", "Calibration", "Starts late by, frames", "Detections", "Ready")


def cameras_table(info: ImportInfo) -> Markup:
    """All rows, and what is not used."""
    heads = [element("th", head, scope="col") for head in HEADS]
    table = element(
        "table",
        element("thead", element("tr", heads)),
        element("tbody", [_row(info, number) for number in range(len(info.cameras))]),
        class_="cams-in",
        aria_label="Cameras",
    )
    # what is not used stays in sight however many cameras there are
    scroll = element("div", table, _left_out(info), class_="cams-scroll")
    told = unused(info)
    return scroll if told is None else joined(scroll, told)


def _left_out(info: ImportInfo) -> Markup | None:
    left = info.wish.left_out
    if not left:
        return None
    words = f"Left out: {', '.join(left)}"
    return element("p", words, wishing("Put back", {"left_out": []}), class_="small unused")


def unused(info: ImportInfo) -> Markup | None:
    """Files that are not used, and why."""
    told = [one.complaint or f"{one.label} is not used" for one in info.files if not one.format]
    words = " · ".join([*told, *info.told])
    if not words:
        return None
    return element("p", words, class_="small unused told", title=words, tabindex=0)


def ready(info: ImportInfo, camera: ImportedCamera) -> bool:
    """Whether nothing is to be decided about a camera."""
    late = camera.offset is not None and camera.offset.sure
    return not (late or _misses_boxes(info, camera) or _without_size(camera))


def _misses_boxes(info: ImportInfo, camera: ImportedCamera) -> bool:
    return not camera.detections and any(other.detections for other in info.cameras)


def _without_size(camera: ImportedCamera) -> bool:
    """Whether the way its boxes are read leaves none of them."""
    return bool(camera.detections) and camera.boxes_per_step == 0.0


def _row(info: ImportInfo, number: int) -> Markup:
    camera = info.cameras[number]
    names = {**info.wish.names, camera.key: "$"}
    name = field(
        f"in-name-{number}", f"Name of {camera.key}", camera.name, {"names": names}, maxlength=60
    )
    blank = element("span", icon("folder"), class_="blank")
    # the file is named for the browser, which shows an address that it has shown before as it was
    query = f"camera={quote(camera.key, safe='')}&of={quote(camera.video, safe='')}"
    address = f"/api/import/{info.key}/picture?{query}"
    picture = element("img", src=address, alt="") if camera.video else None
    shot = element("span", blank, picture, class_="shot")
    frames = f"{camera.frames} frames · {camera.fps:g} fps · " if camera.frames else ""
    boxes = f"{camera.boxes_per_step:g} boxes a step · {camera.boxes_format}"
    missing = _misses_boxes(info, camera)
    none = element("span", "none found", class_="missing" if missing else "small")
    cells: list[Markup] = [
        element("div", shot, name, class_="pic"),
        _two(camera.video or "no video", f"{frames}{camera.width} × {camera.height}"),
        _two(camera.calibration, f"{camera.key} · {info.unit} → m"),
        _sync(info, number),
        _two(_short(info, camera.detections), boxes, camera.detections)
        if camera.detections
        else joined(none, small("a video only" if camera.video else "")),
        _state(info, camera, number),
    ]
    return element("tr", [element("td", cell) for cell in cells])


def _short(info: ImportInfo, label: str) -> str:
    """A file without its folders, as far as cameras stay told apart."""
    parts = label.split("/")
    others = {camera.detections for camera in info.cameras} - {label}
    for count in range(1, len(parts)):
        end = parts[-count:]
        if all(other.split("/")[-count:] != end for other in others):
            return "/".join(end)
    return label


def _two(first: str, second: str, whole: str = "") -> Markup:
    return joined(
        element("span", first, class_="cut", title=whole or first),
        element("span", second, class_="small cut", title=second),
    )


def _sync(info: ImportInfo, number: int) -> Markup:
    camera, fps = info.cameras[number], info.fps
    late = round(camera.seconds_late * fps, 1)

    def moved(by: float) -> dict[str, object]:
        return {"offsets": {**info.wish.offsets, camera.key: -(late + by) / fps}}

    label = f"{camera.name} starts late by, frames"
    stepper = element(
        "span",
        element("button", "−", data_wish=moved(-1), aria_label=f"{camera.name}: a frame less"),
        number_field(
            f"in-late-{number}", label, late, {"offsets": {**info.wish.offsets, camera.key: "#"}},
            0 if late == int(late) else 1, data_scale=-1.0 / fps,
        ),
        element("button", "+", data_wish=moved(1), aria_label=f"{camera.name}: a frame more"),
        class_="stepper",
    )  # fmt: skip
    found = camera.offset
    words = (
        "Nothing to compare"
        if found is None
        else f"Agreement over the offset, best {late + found.steps:.1f} frames late"
    )
    curve = curve_picture(found, late, words)
    return element("div", stepper, curve, class_="sync")


def _state(info: ImportInfo, camera: ImportedCamera, number: int) -> Markup:
    found = camera.offset
    if found is not None and found.sure:
        late = camera.seconds_late * info.fps + found.steps
        wish = {"offsets": {**info.wish.offsets, camera.key: -late / info.fps}}
        words = f"starts {abs(late):.0f} frames {'late' if late > 0 else 'early'}"
        return _fault(words, wishing(f"Apply {late:.0f}".replace("-", "−"), wish))
    if _without_size(camera):
        again = wishing("As found", {"boxes": None, "normalised": None, "first_index": None})
        otherwise = info.wish.boxes or info.wish.first_index is not None
        return _fault("none of its boxes is left as they are read", again if otherwise else None)
    if _misses_boxes(info, camera):
        leave = wishing("Leave out", {"left_out": [*info.wish.left_out, camera.key]}, "")
        offered = [("", "Choose…"), *((one, one) for one in info.offered)]
        files = {"files": [*info.wish.files, [camera.key, "$"]]}
        choice = select(f"in-boxes-{number}", f"Boxes of {camera.name}", offered, "", files)
        return _fault("without boxes it cannot help", choice if info.offered else None, leave)
    return element("span", icon("tick"), "ready", class_="okay")


def _fault(words: str, *buttons: Cell) -> Markup:
    return element(
        "div",
        icon("warn", "s"),
        element("span", words),
        element("span", *buttons, class_="group"),
        class_="fault",
    )
