"""Measure what a mapping lets a simulated person tell: information, thresholds, dose and habituation."""
