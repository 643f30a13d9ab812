"""What was found out of an import: room, checks, target; each can be had otherwise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import get_args

from app.web.importing.models import ImportedCheck, ImportedPair, ImportInfo
from app.web.importing.sheet.building import (
    GROW,
    Cell,
    Markup,
    element,
    heading,
    icon,
    joined,
    number_field,
    segment,
    select,
    size_text,
    small,
    wishing,
)
from app.web.importing.sheet.drawing import plan_picture
from tracker.io.read.pieces import Layout
from tracker.parameters import MethodKey
from tracker.parameters.catalogue import METHODS
from tracker.sequences.sequence import PRESETS

AXES = "xyz"
UPS = ("x", "y", "z", "-x", "-y", "-z")
FOUND = "as found"

LONGEST_PLACE = 30
"""Signs of the folder of recordings; of a longer one the end is shown."""

MOST_LISTED = 6
"""Cameras whose pairs are listed one by one; those of more stand in a square."""

MOST_WORST = 8

STAGES: dict[MethodKey, str] = {
    "single_view": "In each camera",
    "fusion_method": "Fusion",
    "smoothing_method": "Smoothing",
}

SIGNS = {"good": ("tick", "good"), "warning": ("warn", "warn"), "absent": ("minus", "none")}


def _label(words: str, note: str) -> Markup:
    return element("div", element("span", words), element("span", note, class_="cut", title=note),
                   class_="lab")  # fmt: skip


def _why(info: ImportInfo, what: str) -> str:
    """Where a value is from."""
    if getattr(info.wish, what) is not None:
        return "as you say"
    told = dict(info.found).get(what)
    if told is None:
        return "as the file says"
    reason = told.split(";")[0].partition(", ")[2]
    return f"found: {reason or told}"


def room_part(info: ImportInfo) -> Markup:
    """The room from above, its faces, and how the files are read."""
    assert info.room is not None
    words = ", ".join(
        f"{axis} {info.room[0][k]:g} to {info.room[1][k]:g} m" for k, axis in enumerate(AXES)
    )
    keys = "Arrows move its near faces, with Shift the far ones"
    plan = plan_picture(info, f"Room from above, {words}. {keys}")
    fields: list[Markup] = []
    for axis, letter in enumerate(AXES):
        fields += [element("span", letter), *(_face(info, end, axis) for end in (0, 1))]
    cover = [
        element("span", element("i", class_=f"seen-{count}"), str(count) if count < 4 else "4 +")
        for count in (1, 2, 3, 4)
    ]
    wish = info.wish
    restore = None
    if wish.room is not None:
        restore = wishing(joined(icon("reset", "s"), Markup("As suggested")), {"room": None})
    side = element(
        "div",
        element("div", _label("From, to", "metres"), element("div", fields, class_="xyz")),
        element("div", _label("Up", _why(info, "up")), segment("Up", UPS, info.up, "up")),
        element(
            "div",
            _label("File's unit", _why(info, "unit")),
            segment("Unit", ("mm", "cm", "m"), info.unit, "unit"),
        ),
        _choice("Poses", "pose", wish.pose, info.pose, ("world-to-camera", "camera-to-world")),
        _choice("Axes", "axes", wish.axes, info.axes, ("opencv", "opengl")),
        _choice("Boxes", "boxes", wish.boxes, "", get_args(Layout)),
        angles_choice(info),
        _choice("First frame", "first_index", wish.first_index, "", (0, 1)),
        _entrances(info),
        element("div", _label("Floor seen by", "cameras"),
                element("div", cover, class_="keyline small")),
        restore,
        class_="rf",
    )  # fmt: skip
    return element(
        "section",
        heading("Room", small("suggested where people were seen or views overlap; drag its faces")),
        element("div", plan, side, class_="roomy"),
        aria_label="Room",
    )


def _face(info: ImportInfo, end: int, axis: int) -> Markup:
    assert info.room is not None
    corners: list[list[object]] = [list(corner) for corner in info.room]
    corners[end][axis] = "#"
    label = f"Room, {('from', 'to')[end]} {AXES[axis]}, metres"
    value = info.room[end][axis]
    return number_field(f"in-room-{end}-{axis}", label, value, {"room": corners}, step=0.05)


def _entrances(info: ImportInfo) -> Markup | None:
    """Where people come in, as tracks of a first run show it; used where that is wished."""
    used, found = info.wish.entrances, info.entrances
    if not used and not found:
        return None
    if used:
        use = wishing("Use none", {"entrances": []})
        return element("div", f"{len(used)} entrances used", use, class_="lab")
    one = len(found) == 1
    use = wishing("Use it" if one else f"Use all {len(found)}", {"entrances": found})
    return element("div", "Entrances, where tracks begin", use, class_="lab")


def angles_choice(info: ImportInfo) -> Markup | None:
    """How rotations given by three angles are composed, where their names leave it open."""
    if len(info.open_turns) < 2:
        return None
    return _choice("Angles", "turns", info.wish.turns, info.turns, info.open_turns)


def _choice(
    words: str,
    what: str,
    wished: object,
    found: str,
    values: Iterable[str | int | tuple[str, str]],
) -> Markup:
    """A choice among values, each with words of its own or called as it is."""
    plain = f"{found} (found)" if found and wished is None else FOUND
    pairs = (one if isinstance(one, tuple) else (str(one), str(one)) for one in values)
    choices = [("", plain), *pairs]
    mark = "#" if what == "first_index" else "$"
    now = "" if wished is None else str(wished)
    return element(
        "label", words, select(f"in-{what}", words, choices, now, {what: mark}), class_="lab"
    )


def checks_part(info: ImportInfo) -> Markup:
    """All checks, what is odd first; the pairs of cameras; the truth."""
    order = {"warning": 0, "good": 1, "absent": 2}
    checks = sorted(info.checks, key=lambda one: order[one.status])
    fine = sum(one.status == "good" for one in checks)
    odd = sum(one.status == "warning" for one in checks)
    under_way = f"looking at the {info.under_way}…" if info.under_way else ""
    truth = (
        f"{info.truth} people: runs are scored against it."
        if info.truth
        else "None found: runs are not scored."
    )
    return element(
        "section",
        heading("Checks", small(under_way), GROW, small(f"{fine} fine · {odd} to look at")),
        element("div", [*_undecided(info), *map(_check, checks)], class_="checks"),
        _pairs(info),
        _line("good" if info.truth else "absent", "truth", truth),
        class_="in-scroll",
        tabindex=0,
        aria_label="Checks",
    )


def _undecided(info: ImportInfo) -> list[Markup]:
    """What has to be decided before anything is written, with a button for each way."""
    if not info.undecided:
        return []
    if info.question is None:
        taken = info.wish.model_copy(update={"accept_best": True}).model_dump(mode="json")
        button = wishing("Import it as it is", taken, title="--accept-best")
        return [_line("warning", "unexplained", info.undecided, button)]
    ways = zip(info.question.wishes, info.question.interpretations, info.question.flags,
               strict=True)  # fmt: skip
    buttons = [
        wishing(words[:1].upper() + words[1:], wish.model_dump(mode="json"), title=flag)
        for wish, words, flag in ways
    ]
    return [_line("warning", "open", info.question.difference, *buttons)]


def _check(one: ImportedCheck) -> Markup:
    sentence = one.sentence + (f": {one.remedy}" if one.remedy and one.mend is None else "")
    mend = None
    if one.mend is not None:
        wish = one.mend.model_dump(mode="json")
        mend = wishing("Apply", wish, "main", title=one.remedy, aria_label=f"Apply {one.remedy}")
    return _line(one.status, one.name, sentence, mend)


def _line(status: str, name: str, words: str, *more: Cell) -> Markup:
    sign, kind = SIGNS[status]
    name = name[:1].upper() + name[1:]
    words = words[:1].upper() + words[1:]
    told = element("p", element("b", name), " ", words)
    return element("div", icon(sign, kind), told, *more, class_="chk")


def _pairs(info: ImportInfo) -> Markup | None:
    if not info.pairs:
        return None
    if len(info.cameras) > MOST_LISTED:
        return _grid(info)
    cells = [
        element(
            "span",
            f"{pair.first} – {pair.second} ",
            element("b", "none" if pair.pixels is None else f"{pair.pixels:.1f} px"),
            class_="w" if pair.odd else None,
            title=f"{100 * pair.share:.0f} % of their boxes meet",
        )
        for pair in info.pairs
    ]
    return element("div", cells, class_="pairs", role="group",
                   aria_label="How far boxes of two cameras miss each other")  # fmt: skip


def _grid(info: ImportInfo) -> Markup:
    """All pairs as a square, pixels without their sign, and the worst beside it."""
    names = [camera.name for camera in info.cameras]
    by_names = {frozenset((pair.first, pair.second)): pair for pair in info.pairs}
    heads = [element("th", str(number + 1), title=name) for number, name in enumerate(names)]
    rows = []
    for number, name in enumerate(names):
        cells = [
            _cell(by_names.get(frozenset((name, other))), name, other) for other in names[:number]
        ]
        rows.append(element("tr", element("th", f"{number + 1} {name}", scope="row"), cells))
    table = element(
        "table",
        element("thead", element("tr", element("td"), heads)),
        element("tbody", rows),
        aria_label="How far boxes of two cameras miss each other, pixels",
    )
    worst = sorted(info.pairs, key=lambda pair: (not pair.odd, -(pair.pixels or 0.0)))
    listed = [
        element("li", f"{pair.first} – {pair.second} ", element("b", _pixels(pair, " px")),
                class_="w" if pair.odd else None)
        for pair in worst[:MOST_WORST]
    ]  # fmt: skip
    beside = element("div", small("worst first"), element("ol", listed))
    return element("div", table, beside, class_="pair-grid")


def _cell(pair: ImportedPair | None, first: str, second: str) -> Markup:
    if pair is None:
        return element("td", "", title=f"{first} – {second}: nothing to compare")
    words = f"{first} – {second}: {100 * pair.share:.0f} % of their boxes meet"
    return element("td", _pixels(pair), class_="w" if pair.odd else None, title=words)


def _pixels(pair: ImportedPair, sign: str = "") -> str:
    return "none" if pair.pixels is None else f"{pair.pixels:.1f}{sign}"


def target_part(info: ImportInfo) -> Markup:
    """What is tracked, and where the recording is kept."""
    half, suggested = info.half_extents, info.suggested_half_extents
    assert half is not None
    assert suggested is not None
    rows = [("Suggested", suggested, None), *((w, own, own) for w, own in PRESETS.items())]
    pressed = next((n for n, (_, own, _) in enumerate(rows) if _same(own, half)), -1)
    choices = [
        _chosen(words, _size(own), number == pressed, {"half_extents": value})
        for number, (words, own, value) in enumerate(rows)
    ]
    own_size: list[Markup] = []
    for axis, words in enumerate(("Width", "Depth", "Height")):
        wish: list[object] = list(half)
        wish[axis] = "#"
        own_size.append(
            number_field(
                f"in-size-{axis}", f"{words} of the target, metres", 2.0 * half[axis],
                {"half_extents": wish}, data_scale=0.5, step=0.01, min=0.02,
            )
        )  # fmt: skip
    own_row = element(
        "div",
        element("b", "Own size"),
        element("span", own_size),
        class_="choice own",
        aria_current="true" if pressed < 0 else None,
    )
    return element(
        "section",
        heading("Target"),
        element("div", choices, own_row, class_="choices"),
        heading("Kept"),
        _kept(info),
        heading("Then track with"),
        _methods(info),
        class_="in-scroll",
        tabindex=0,
        aria_label="Target and place",
    )


def _methods(info: ImportInfo) -> Markup:
    """What it is tracked with: what fits, or what is chosen here."""
    boxes = "By the boxes: no templates are needed."
    colours = "By what moves, until boxes are dragged on the pictures for colours."
    rows = []
    for key, words in STAGES.items():
        fits = info.fitting.get(key, "")
        choices = [("", f"{fits} (fits)" if fits else FOUND), *((m, m) for m in METHODS[key])]
        rows.append(
            element(
                "label",
                words,
                select(f"in-{key}", words, choices, info.wish.methods.get(key) or "",
                       {"methods": {**info.wish.methods, key: "$"}}, info.unfit.get(key)),
                class_="lab",
            )
        )  # fmt: skip
    return joined(element("p", boxes if info.has_boxes else colours), *rows)


def _same(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(abs(a - b) < 2e-3 for a, b in zip(one, other, strict=True))


def _size(half: Sequence[float]) -> str:
    return " × ".join(f"{2.0 * side:.2f}" for side in half) + " m"


def _chosen(
    words: str, value: str, pressed: bool, wish: dict[str, object], note: str = ""
) -> Markup:
    return element(
        "button",
        element("b", words),
        element("span", value),
        small(note) if note else None,
        class_="choice",
        aria_pressed=str(pressed).lower(),
        data_wish=wish,
    )


def _kept(info: ImportInfo) -> Markup:
    free = f"{size_text(info.free)} free there"
    home = info.home
    if len(home) > LONGEST_PLACE:
        home = f"…{home[1 - LONGEST_PLACE :]}"
    if info.uploaded:
        words = f"{size_text(info.bytes)} uploaded to {home}, {free}."
        return element("p", words, title=info.home)
    copies = info.wish.copy_files
    return element(
        "div",
        _chosen("Link", "", not copies, {"copy_files": False}, "The videos stay where they are."),
        _chosen("Copy", size_text(info.bytes), copies, {"copy_files": True},
                f"Into {home}, {free}."),
        class_="choices",
    )  # fmt: skip
