"""The routes of the library: recordings, runs, and what a run looks like in small."""
