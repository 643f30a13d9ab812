"""The example file that ``study new`` writes, with an explanation of every field."""

from __future__ import annotations

import json
from collections.abc import Sequence

from tracker.parameters.catalogue import PARAMETERS
from tracker.studies.definition.space import around

_KEYS = ("fusion.detection_probability", "fusion.clutter_rate", "fusion.acceleration_sigma")


def example(name: str, recordings: Sequence[str]) -> str:
    """Return the text of an example of a study's file.

    Args:
        name: The name of the study.
        recordings: Names of built-in recordings, or folders.
    """
    listed = ", ".join(json.dumps(one, ensure_ascii=False) for one in recordings)
    ranges = []
    for key in _KEYS:
        parameter, one = PARAMETERS[key], around(key, PARAMETERS[key].default)
        unit = f" {parameter.unit}" if parameter.unit else ""
        log = ", log = true" if one.log else ""
        ranges.append(f"# {parameter.symbol}{unit}: {parameter.help}")
        ranges.append(f'"{key}" = {{ low = {one.low:g}, high = {one.high:g}{log} }}')
    joined = "\n".join(ranges)
    return f"""# A study of multiview-phd. Run it by: multiview-phd study run FILE

name = {json.dumps(name, ensure_ascii=False)}

# Rendered rooms, folders, or patterns of folders such as "recordings/*"; paths from this file on.
recordings = [{listed}]

# How many values are tried. The first trial is always the defaults.
trials = 60

# No trial begins after so many minutes; without this line there is no such bound.
# minutes = 30

# How often each is run on each recording (seeds 0, 1, …), or a list of seeds.
seeds = 1

# "tpe", "nsga2", "random", "grid", or "auto": TPE for one objective, NSGA-II for several.
search = "auto"

# What is sought, the leading figure first: any of `evaluate`, "score" (the mean of HOTA and IDF1),
# "speed", or "identity", which needs no truth. Without this line: HOTA, IDF1 and speed where all
# recordings have a truth, else identity.
objectives = ["score"]

# Whether hopeless trials are given up after a third of their runs.
prune = true

# On how many other seeds the best are measured again at the end, before one is proposed.
propose = 2

# Values to start from, and the sampler's seed.
preset = "robust"
seed = 0

# What all trials have, by key; `multiview-phd parameters` lists the keys.
[values]
# smoothing_method = "none"

# What is varied. A number takes low, high, log and, for a grid, steps; what is left out follows
# from its definition. Anything else takes choices. A parameter counts only where its method and
# the values it depends on are chosen.
[parameters]
{joined}
smoothing_method = {{ choices = ["positions", "identities"] }}
"""
