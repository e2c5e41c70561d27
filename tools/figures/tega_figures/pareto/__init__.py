"""Measure run time against error of what a session may choose, and write docs/evidence/pareto.md.

One module a subject; each measures its variants and says why the default is what it is. ``drawing`` draws them all
and makes their tables.
"""
