"""The page of the commands of the address ``/api/commands``, from their models."""

from __future__ import annotations

from typing import Any, get_args

from app.errors import COMMANDS
from app.web.commands import AnyCommand

FORMER = {
    "set_parameters": "PATCH /api/parameters",
    "reset_parameters": "POST /api/parameters/reset",
    "apply_preset": "POST /api/parameters/preset",
    "use_again": "POST /api/run/again/{number}",
    "save_preset": "POST /api/presets",
    "rename_preset": "PATCH /api/presets/{name}",
    "remove_preset": "DELETE /api/presets/{name}",
    "undo": "POST /api/undo",
    "redo": "POST /api/redo",
    "add_template": "POST /api/teach/templates",
    "rename_template": "PATCH /api/teach/templates/{index}",
    "remove_template": "DELETE /api/teach/templates/{index}",
    "offer_templates": "POST /api/teach/offers",
    "take_offers": "POST /api/teach/offers/taken, …/offers/{index}/taken",
    "forget_offers": "DELETE /api/teach/offers",
    "set_room_face": "PATCH /api/teach/room/{side}/{axis}",
    "set_target": "POST /api/teach/target",
    "set_target_side": "PATCH /api/teach/target/{axis}",
    "add_entrance": "POST /api/teach/entrances",
    "suggest_entrances": "POST /api/teach/entrances/suggested",
    "set_entrance": "PATCH /api/teach/entrances/{index}/{part}/{axis}",
    "remove_entrance": "DELETE /api/teach/entrances/{index}",
    "discard_taught": "POST /api/teach/discard",
    "edit_room": "POST /api/teach/editing",
    "save_taught": "POST /api/teach/save",
    "copy_taught": "POST /api/teach/copy",
    "correct": "POST /api/corrections",
    "drop_correction": "DELETE /api/corrections/{correction}",
    "answer": "POST /api/corrections/answers",
    "skip": "POST /api/corrections/skips",
    "mark_run": "PATCH /api/library/runs/{number}",
    "delete_runs": "POST /api/library/delete",
    "use_trial": "POST /api/studies/{name}/trials/{number}/use, …/tuned/use",
    "keep_trial": "POST /api/studies/{name}/trials/{number}/preset, …/tuned/preset",
}
"""The routes that commands stand for, which are gone."""

INTRODUCTION = f"""# Commands

What a person edits on the page another program edits as well: by `POST {COMMANDS}`, with the name
of a command and its fields as JSON. Edits of parameters, presets, the room, templates, corrections
and marks of the library are undone by `undo` or by Ctrl Z in the page, also after the next start of
the program.

```sh
curl -H "Authorization: Bearer $MULTIVIEW_PHD_TOKEN" -H "Content-Type: application/json" \\
  -d '{{"name": "set_parameters", "changes": {{"fusion.clutter_rate": 1.5}}}}' \\
  http://127.0.0.1:8000{COMMANDS}
```

The answer is 204 without a body, or 200 with what only who asked needs: commands of parameters and
presets, `undo`, `redo`, `use_trial` and `keep_trial` answer with the state that they lead to,
`delete_runs` with the bytes that were freed. What is refused changes nothing, and says in one
sentence which field was expected to be what. `/docs` of a running workbench has every field with
its bounds, and the routes that read.

| command | fields | what it does | formerly |
|---|---|---|---|
"""


def page() -> str:
    """The page's text: one row a command."""
    return INTRODUCTION + "".join(_row(kind) for kind in get_args(AnyCommand))


def _row(kind: Any) -> str:
    fields = kind.model_fields
    (name,) = get_args(fields["name"].annotation)
    own = [
        f"`{key}`" if field.is_required() else f"`{key}`?"
        for key, field in fields.items()
        if key != "name"
    ]
    words = " ".join(kind.__doc__.split())
    former = ", ".join(f"`{one}`" for one in FORMER[name].split(", "))
    return f"| `{name}` | {', '.join(own)} | {words} | {former} |\n"
