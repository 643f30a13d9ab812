"""What outlives a start, and what can be taken back: presets, drafts, recent recordings, undo."""
