"""Studies: many runs with varied parameters, on one machine or on a cluster.

A study is a folder with its definition (:mod:`tracker.studies.definition.definition`), the
sampler's journal, and every result. The process that runs it (:mod:`tracker.studies.running`) may
be killed at any time; the study can be resumed from the folder.
"""
