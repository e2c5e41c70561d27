"""Measure and draw what the pages of the docs show: benchmarks, tables and pictures."""
