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

Beside the 3D view are the essential parameters of the chosen methods, as plain sliders, with
presets and methods below them; a hint gives unit, range, default and published value. The tab
*Parameters* lists all parameters that have an effect with these methods, by topic, the essential
ones first, each with a slider, a number and the unit. A range over decades has a logarithmic
slider; a tick on a slider marks the published value. Both places show the same values; while a
slider is dragged or a number is typed, changes from elsewhere do not overwrite it.

- A click on a name shows the help, range, default and published value, with a link to this page.
- The search field above the table searches name, symbol, key, unit and help; *changed only* hides
  parameters at their defaults. The palette (Ctrl+K) also sets a parameter by its name, or shows it
  in the table.
- The arrow of a changed row resets it, *Reset all* resets every value and method; *Save as* stores
  all values as a preset.
- A recording opens with the values it was left with, also when the workbench starts on it; `track`
  always begins with the defaults.
- *Effect* above the table runs the recording with a few other values of each of the first twelve
  listed parameters, in the background, while nothing else is computed. Each row then
  shows the curve of MOTA (without ground truth: of the number of tracks) over the values, and the
  share of the variance of MOTA over all these runs that this parameter alone explains: the
  importance that [studies](studies.md) report, here with one parameter varied at a time.

## In which order

1. **Choose what is measured.** With templates and pictures: `colour_phd`. With pictures alone:
   `onnx_detector` if a network was fetched and people are 100 pixels high or more, else `shapes`,
   or `jpda` and `association_matrix`, which look at the foreground. With a detector's boxes: `none`
   or `detection_phd`.
2. **Stage 1 first**: look at the boxes in the pictures. A person without a box in any camera is not
   tracked; boxes on furniture that stay at one place can become false tracks.
   `acceptance_distance`, `acceptance_foreground` and the foreground's `threshold` have the largest
   effect.
3. **Then the fusion**: `clutter_rate` is the mean number of boxes per camera and step that belong
   to no person, `detection_probability` the share of the visible people who have a box. Estimate
   both by counting boxes in the pictures.
4. **Then the identities**: the fusion's birth, motion and recognition.
5. **Last the extraction threshold**, the weight above which a component is reported; after a change
   of it no filter runs again.

Before a change, `Pin as A` stores the shown run as A: the timeline and the Compare tab then show
both runs.

A preset, study, stored run, address or command of an earlier version may name a parameter that no
longer exists. It opens without that value, and a note names the value that holds instead.

## How to read the pictures

Each picture shows runs of a short piece of a sequence, one for every marked value, with all other
parameters at their defaults. Left: the share of true positions with an estimate within 0.3 m.
Middle: false estimates per step. Right: mean error in metres. The dashed line is the default. The
pictures show the direction and the scale of an effect on *that* piece, not the best value for
yours; a flat line means that the parameter has no effect on this piece. The values are in
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
