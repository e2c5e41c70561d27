"""Receive muscle signals and closures from the Lab Streaming Layer: the driver ``lsl-emg``, the decoder ``lsl``."""
