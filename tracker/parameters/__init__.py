"""Every tunable number, once: default, range, unit, symbol, topic, help and stage.

From these definitions come the sliders, the command-line flags, the table of
``multiview-phd parameters``, the schema of the API and the cache keys.

Exported here is what the author of a method imports: with it alone a method is described, so that
another package can be imported before or after this one. The numbers are in
:mod:`tracker.parameters.groups`, all of them together in :mod:`tracker.parameters.catalogue`, and
:mod:`tracker.parameters.values` reads and changes them.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021. A field's ``published`` value is the one of that paper,
where the default differs from it.
"""

from tracker.parameters.definition import Params, Stage, Topic, ui
from tracker.parameters.method import Method, MethodKey, Reads, Uses, Values

__all__ = ["Method", "MethodKey", "Params", "Reads", "Stage", "Topic", "Uses", "Values", "ui"]
