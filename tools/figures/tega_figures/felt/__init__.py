"""Measure what a mapping lets a simulated person distinguish: information, thresholds, dose and habituation."""
