"""Read EMG from any board that BrainFlow knows: the driver ``brainflow``."""
