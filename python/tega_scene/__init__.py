"""Measure a lift by scene cameras: printed tags on table, hand and object give poses, and poses give outcomes."""
