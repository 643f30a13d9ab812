"""Studies: many runs with varied parameters, on one machine or on a cluster.

A study is a folder with its definition (:mod:`tracker.studies.definition`), every trial and every
result (:mod:`tracker.studies.store`). The process that runs it (:mod:`tracker.studies.runner`) may
be killed at any time; the study can be resumed from the folder.
"""
