"""Benchmarks: ``python -m tests.benchmarks [--short] [--json FILE] [NAME …]``.

Times say what this machine did this time and never fail anything. What fails is a
ratio between two of our own ways of doing the same thing in one run, such as a
kernel against its plain NumPy reference, when it falls below its bound.
"""
