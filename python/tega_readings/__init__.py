"""Measure contacts by any reading of Eq 1 to 6: the metric ``reading``."""
