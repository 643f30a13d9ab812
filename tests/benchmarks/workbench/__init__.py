"""The workbench's benchmarks: how long somebody waits before it."""
