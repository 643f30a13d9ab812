"""Benchmarks: ``python -m tests.benchmarks [--short] [--json FILE] [--record] [NAME …]``.

Times say what this machine did this time and never fail anything. What fails is a
ratio between two of our own ways of doing the same thing in one run, such as a
kernel against its plain NumPy reference, when it falls below its bound; and a figure of
accuracy that is worse than on record (:mod:`tests.benchmarks.record`).
"""
