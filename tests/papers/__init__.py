"""The claims of the papers, run again: ``python -m tests.papers NAME``.

One module a claim in :mod:`tests.papers.claims`; its ``EXPERIMENT`` is entered in
:mod:`tests.papers.registry`.
"""
