"""Learn a decoder from EMG to closure, and compare decoders: :mod:`tega_learn.decoders`."""
