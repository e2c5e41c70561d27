"""Lead through a device's first hour: identity, rate, latency, limits, one least motion, and stop.

Everything goes through the driver that a run would use. Motions and sensations have the least strength, and need a
person's confirmation first; :func:`tega_bench.acceptance.run.accept_device` makes the report.
"""
