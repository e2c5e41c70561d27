"""Read text tables of other programs: look before believing, and refuse where two readings are possible."""
