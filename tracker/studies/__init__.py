"""Studies: many runs with other values, on one machine or on a cluster, kept as they end.

A study is a folder: its definition (:mod:`tracker.studies.defined.definition`), what was asked of
the sampler, and every result. Whoever runs it (:mod:`tracker.studies.running`) may be killed at any
moment; the next one goes on from the folder.
"""
