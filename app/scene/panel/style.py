"""The style sheet of viser's panel, to have it as compact as the page around it.

viser has no hook for styles, so they travel as an HTML element of the panel. The class names are
those of its client in the version that the project pins.
"""

from __future__ import annotations

PANEL = """<style>
:root { --mvp-ink-1: #ededed; --mvp-ink-2: #bdbdbd; --mvp-ink-3: #979797; --mvp-busy: #6cb2f5;
  --mvp-field: #2e2e2e; --mvp-line: #383838; --mvp-thumb: #f1f3f5; --mvp-rim: transparent; }
[data-mantine-color-scheme="light"] { --mvp-ink-1: #1b1b1b; --mvp-ink-2: #444444;
  --mvp-ink-3: #656565; --mvp-busy: #1a66b0; --mvp-field: #ffffff; --mvp-line: #dededb;
  --mvp-thumb: #ffffff; --mvp-rim: #1a66b0; }
/* the page says by itself, and once, that there is no graphics card */
.mantine-Notification-root:has([class*="Notification-title"]) { display: none; }
/* the step */
.mvp-status { padding: 0 16px 6px 10px; color: var(--mvp-ink-2); line-height: 16px; }
.mvp-status p { margin: 0 0 2px; font-size: 13px; font-variant-numeric: tabular-nums; }
.mvp-status b { color: var(--mvp-ink-1); font-weight: 600; }
.mvp-status span { float: right; font-size: 12px; }
.mvp-status small { display: block; font-size: 10px; line-height: 14px; color: var(--mvp-ink-3); }
.mvp-status[data-state="computing"] span { color: var(--mvp-busy); }
/* inside the page, which says the step, and whether the server answers, by itself */
.mvp-inside .mvp-status[data-step],
.mvp-inside .mantine-Paper-root > div > div:first-child:has(> div > svg) {
  display: none !important; }
/* rows: label, slider, number */
div:has(> .mantine-Flex-root > div > .mantine-Text-root > label[for]) {
  padding: 0 16px 2px 10px !important; }
.mantine-Flex-root:has(> div > .mantine-Text-root > label[for]) { min-height: 25px; }
div:has(> .mantine-Text-root > label[for]) { width: 128px !important; flex-shrink: 0;
  padding-right: 8px !important; }
/* a slider lies under its words and as wide as they; its number stands beside them */
.mantine-Flex-root:has(> div > .mantine-Text-root > label[for]):has(.mantine-Slider-root) {
  flex-wrap: wrap; position: relative; min-height: 33px; }
.mantine-Flex-root:has(.mantine-Slider-root) > div:has(> .mantine-Text-root > label[for]) {
  width: 100% !important; padding-right: 60px !important; white-space: nowrap; }
.mantine-Flex-root:has(.mantine-Slider-root) > div:has(> .mantine-Text-root) + div {
  width: 100%; }
.mantine-Flex-root > div + div .mantine-NumberInput-root { position: absolute !important;
  right: 0; top: -4px; }
label[for]::after { font-size: 80%; vertical-align: -0.25em; }
.mantine-Flex-root:has(.mantine-Select-root) > div:first-child { width: 92px !important; }
.mantine-Text-root:has(> label[for]) { font-size: 11px !important; line-height: 13px !important;
  letter-spacing: 0 !important; font-weight: 400 !important; color: var(--mvp-ink-2) !important;
  overflow-wrap: normal !important; }
label[for] > wbr { display: none; }
label[for] { cursor: help; }
.mantine-Slider-root { padding: 0 !important; align-self: center; }
.mantine-Slider-mark, .mantine-Slider-markLabel { display: none !important; }
.mantine-Slider-thumb { background: var(--mvp-thumb) !important;
  border: 1px solid var(--mvp-rim) !important;
  width: 6px !important; height: 12px !important; }
.mantine-NumberInput-root { width: 48px !important; margin-left: 10px !important; }
.mantine-Input-input { font-size: 11px !important; letter-spacing: 0 !important;
  min-height: 22px !important; height: 22px !important; padding: 0 6px !important;
  background: var(--mvp-field); border-color: var(--mvp-line); color: var(--mvp-ink-1);
  font-variant-numeric: tabular-nums; }
.mantine-Checkbox-root { transform: scale(.8); transform-origin: left; }
.mvp-group { padding: 4px 10px 2px; font-size: 10px; line-height: 13px;
  color: var(--mvp-ink-3); }
/* sections with a line above instead of frames */
.mantine-Paper-root:has(> .mantine-Paper-root + div) { margin: 0 !important;
  padding: 0 0 6px !important; border: 0 solid var(--mvp-line); border-top-width: 1px !important;
  border-radius: 0; background: none; }
.mantine-Paper-root:has(> .mantine-Paper-root + div) > .mantine-Paper-root {
  position: static; transform: none; padding: 7px 10px 3px !important; background: none;
  font-size: 12px; font-weight: 600; line-height: 16px; color: var(--mvp-ink-1); }
.mantine-Paper-root:has(> .mantine-Paper-root + div) [style*="padding-top"] {
  padding-top: 0 !important; }
.mantine-Button-root { height: 24px !important; min-height: 24px !important;
  font-size: 11px !important; }
</style>"""


NUMBER = """height: 22px; line-height: 20px; padding: 0 6px; border: 1px solid var(--mvp-line);
border-radius: 3px; background: var(--mvp-field); color: var(--mvp-ink-1); font-size: 11px;
box-sizing: border-box; white-space: nowrap; font-variant-numeric: tabular-nums;"""


def symbols(indices: dict[str, tuple[str, str]]) -> str:
    """Style that writes the subscript of a symbol, and the unit after it.

    Args:
        indices: Subscript and unit, by the input's id.
    """
    rules = []
    for uuid, (index, unit) in indices.items():
        if index:
            rules.append(f'label[for="{uuid}"]::after {{ content: "{index}"; }}')
        if unit:
            rules.append(f'*:has(> label[for="{uuid}"])::after {{ content: "  {unit}"; }}')
    return f"<style>{' '.join(rules)}</style>"


def values(numbers: dict[str, str], marked: list[str]) -> str:
    """Style that depends on the values.

    Args:
        numbers: What stands beside a slider in place of its own number, by the slider's id.
        marked: Ids of inputs whose label is stronger.
    """
    rules = [
        f'[id="{uuid}"] + .mantine-InputWrapper-root::after {{ content: "{text}"; }}'
        for uuid, text in numbers.items()
    ]
    hidden = ",".join(f'[id="{uuid}"] + .mantine-InputWrapper-root' for uuid in numbers)
    labels = ",".join(f'label[for="{uuid}"]' for uuid in marked)
    if hidden:
        rules.append(f"{hidden} {{ {NUMBER} }}")
        inputs = ",".join(f'[id="{uuid}"] + .mantine-InputWrapper-root > *' for uuid in numbers)
        rules.append(f"{inputs} {{ display: none; }}")
    if labels:
        rules.append(f"{labels} {{ color: var(--mvp-ink-1); font-weight: 600; }}")
    return f"<style>{' '.join(rules)}</style>"
