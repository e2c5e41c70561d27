"""Emulated devices: programs of their own that speak a device's bytes, with faults that can be switched on."""
