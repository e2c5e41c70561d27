"""Emulated devices: programs of their own that send a device's bytes, with faults that can be switched on."""
