"""Change the product's code in one place at a time, and count the changes that no test detects.

``python -m tega_campaigns.mutants cover`` runs the tests that need no waiting once and notes which of them run which
line. ``… python --n 200 --seed 1`` and ``… rust --n 100 --seed 1`` draw changes (cosmic-ray and cargo-mutants make
them) and try each in a copy of the last commit. ``… table`` prints the result. Everything is kept in ``--out``: a
second call goes on where the first one ended.
"""
