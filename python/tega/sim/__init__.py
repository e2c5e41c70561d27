"""Simulated input: what TEGA generates for itself where no device is attached. Simulated, and labelled so."""
