"""Run time against error: what the kernels cost, what a whole tick costs, and how exact each way is.

Everything is measured in one run and in turns, so that a machine that is busy is busy for all alike; ratios are what
to compare. The packages that TEGA is compared with are optional: what is not installed is listed, not measured.
"""
