"""Learn a decoder from EMG to closure, keep it as a file, and compare decoders on one log.

:func:`fit` learns from EMG beside a target closure or a measured force; :class:`LearnedDecoder` runs the model with
NumPy alone. :class:`ProportionalDecoder` is the plain baseline. In a run they are chosen by name, see
``docs/evidence/emg-decoders.md``.
"""

from tega_learn.block_features import FEATURES
from tega_learn.learned import Decoded, LearnedDecoder
from tega_learn.model import Model, load_model, save_model
from tega_learn.proportional import ProportionalDecoder
from tega_learn.training import fit

__all__ = [
    "FEATURES",
    "Decoded",
    "LearnedDecoder",
    "Model",
    "ProportionalDecoder",
    "fit",
    "load_model",
    "save_model",
]
