"""The page of tuning: each parameter from its definition, with a picture of what it does."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from app.command.flags import describe_range, show
from tests.manual.plots import picture
from tests.manual.records import sweeps
from tracker.parameters.catalogue import GROUPS, METHODS, PARAMETERS, Parameter, RunParameters

STAGES = {
    "single_view": "Stage 1, single view",
    "fusion": "Stage 2, fusion",
    "smoothing": "Stage 3, smoothing",
    "tracks": "Stage 4, tracks",
}

INTRODUCTION = """# Tuning: what each parameter does

This page is made from the definitions in `tracker/parameters`, like the sliders, the flags of
`track` and the table of `multiview-phd parameters`.

## Where they are set

Beside the 3D view are the essential ones of the methods in use, as plain sliders, with presets and
methods below them; a hint says unit, range, default and what is published. The tab *Parameters*
has all that have an effect with these methods, by topics, the essential ones first: slider, number
and unit of each. The slider of a range over decades is logarithmic; a tick on it is the published
value. What is set in one place shows in the other, and whoever holds a slider or types keeps it.

- A click on a name tells what it is, its range, default and published value, and leads here.
- The field in the table's head finds words of name, symbol, key, unit or help; *changed only*
  leaves out what stands at its default. The palette (Ctrl+K) sets a parameter by its name too, or
  shows it in the table.
- The arrow of a changed row resets it, *Reset all* every value and method; *Save as* keeps all
  under a name.
- *Effect* in the head runs the recording with a few other values of each of the first twelve
  parameters that are listed, in the background, until somebody works again. A row then has the
  curve of MOTA (without truth: of the number of tracks) over the values, and the share of its
  variance that the parameter explains alone, among those that were run. That is the importance
  which [studies](studies.md) report, with one parameter moved at a time.

## In which order

1. **Choose what is measured.** With templates and pictures: `colour_phd`. With pictures alone:
   `onnx_detector` where a network is at hand and people are 100 pixels high or more, else
   `shapes`, or `jpda` and `association_matrix`, which look at the foreground. With a detector's
   boxes: `none` or `detection_phd`.
2. **Look at stage 1 first**: the boxes in the pictures. Somebody without a box in any camera
   cannot be found; boxes on furniture that stay at one place can become ghosts.
   `acceptance_distance`, `acceptance_foreground` and the foreground's `threshold` decide most.
3. **Then the fusion**: `clutter_rate` is how many of the boxes you saw were nobody,
   `detection_probability` how often a visible person had one. These two are counts that you can
   read off the pictures rather than knobs to be turned.
4. **Then who is whom**: the fusion's birth, motion and recognition.
5. **Last the threshold of extraction**, which re-runs nothing: it only says how sure is sure.

Pin a run as A (`Pin as A`) before a change; lanes, strips and the Compare tab then show both.

A preset, study, kept run, address or command of an earlier version may name a parameter that no
longer exists. It opens all the same, without that value, and a note says what holds instead.

## How to read the pictures

Each is a short piece of a sequence, run once for every marked value, all other parameters at
their defaults. Left: the share of true positions with an estimate within 0.3 m. Middle: false
estimates a step. Right: mean error in metres. The dashed line is the default. They show the
direction and the scale of an effect on *that* piece, not the best value for yours; a flat line
means that this piece does not need the parameter. The values are in
`static/manual/records/sweeps.json`, made by `python3 -m tests.manual --sweeps`.
"""


def page() -> str:
    """The whole page."""
    return "\n".join([INTRODUCTION, *_methods(), *_groups()]).rstrip() + "\n"


def _methods() -> Iterator[str]:
    yield "## Methods"
    yield ""
    for key, choices in METHODS.items():
        field = RunParameters.model_fields[key]
        yield f"### {key.replace('_', ' ').capitalize()} {{ #{key} }}"
        yield ""
        yield f"{' '.join((field.description or '').split())}"
        yield ""
        names = ", ".join(f"`{name}`" for name in choices)
        yield f"One of {names}; [Methods](methods.md) tells what each is."
        yield ""


def _groups() -> Iterator[str]:
    records = sweeps.kept()
    for group, words in GROUPS.items():
        own = [p for p in PARAMETERS.values() if p.group == group]
        yield f"## {group.replace('_', ' ').capitalize()} {{ #{group} }}"
        yield ""
        yield " ".join(words.split())
        yield ""
        for parameter in own:
            yield from _entry(parameter, records.get(parameter.key))


def _entry(parameter: Parameter, sweep: dict[str, Any] | None) -> Iterator[str]:
    yield f"### {parameter.label} {{ #{parameter.key} }}"
    yield ""
    yield parameter.help
    yield ""
    facts = [f"`{parameter.key}`", parameter.symbol]
    numeric = parameter.kind in ("float", "int")
    if numeric:
        facts.append(f"{describe_range(parameter)} {parameter.unit}".strip())
    else:
        facts.append(" or ".join(f"`{choice}`" for choice in describe_range(parameter).split("|")))
    facts.append(f"default **{show(parameter.default)}**")
    if parameter.published is not None:
        facts.append(f"as published {show(parameter.published)}")
    facts.append(STAGES[parameter.stage])
    yield " · ".join(fact.replace("|", "\\|") for fact in facts)
    yield "{ .parameter }"
    yield ""
    if sweep is not None and len(sweep["points"]) > 1:
        yield picture(parameter, sweep)
        yield ""
