"""Compute TEGA's equations exactly: the one reference an equation that tests, benchmarks and pages judge by.

Whole numbers and fractions for the contact metrics, 60-digit decimals for the EMG filter and the vest intensity;
written from the equations alone, without a line of what they judge.
"""

from __future__ import annotations

from tega_figures.exact.contact import ExactContact, exact_contact, exact_paper, printed
from tega_figures.exact.emg import dc_gain, design, filtered, gain_squared
from tega_figures.exact.vest import exact_intensity

__all__ = [
    "ExactContact",
    "dc_gain",
    "design",
    "exact_contact",
    "exact_intensity",
    "exact_paper",
    "filtered",
    "gain_squared",
    "printed",
]
