"""The engine's benchmarks: how fast and how well people are found."""
