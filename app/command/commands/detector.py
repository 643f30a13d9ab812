"""``detector``: the detection networks that are at hand, and the fetching of one."""

from __future__ import annotations

from app.command.arguments.detector import Detector, GetDetector, ListDetectors
from app.command.terminal import Bar, print_json, print_table, say
from tracker.sequences.detectors import FetchedDetector, fetched_detectors


def detector(command: Detector) -> None:
    """Run one of the commands.

    Raises:
        ValueError: If the network cannot be fetched.
        OSError: If it cannot be written.
    """
    match command.action:
        case GetDetector():
            _get()
        case ListDetectors(json):
            _list(json)


def _get() -> None:
    from tracker.single_view.onnx.fetching import NANODET, fetch

    with Bar("fetching", "B") as bar:
        found = fetch(NANODET, bar.at)
    say(
        f"{found.name} ({NANODET.licence}, {found.size / 1e6:.1f} MB) is in {found.folder}: "
        "single_view onnx_detector runs it on pictures"
    )


def _list(json: bool) -> None:
    found = list(fetched_detectors())
    if json:
        print_json([_values(one) for one in found])
        return
    if not found:
        say("no detector was fetched; `multiview-phd detector get` fetches one")
        return
    rows = [
        (
            one.name,
            "" if one.record is None else one.record.licence,
            f"{one.size / 1e6:.1f}",
            "" if one.record is None else one.record.source,
            str(one.path) + (f" ({one.damage})" if one.damage else ""),
        )
        for one in found
    ]
    print_table(("name", "licence", ">MB", "from", "path"), rows)


def _values(one: FetchedDetector) -> dict[str, object]:
    record = one.record
    return {
        "name": one.name,
        "licence": None if record is None else record.licence,
        "source": None if record is None else record.source,
        "sha256": None if record is None else record.sha256,
        "size": one.size,
        "path": str(one.path),
        "damage": one.damage or None,
    }
