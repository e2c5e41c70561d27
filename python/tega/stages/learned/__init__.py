"""Learn a decoder from EMG to closure, keep it as a file, and compare decoders on one log.

:func:`fit` learns from EMG beside a target closure or a measured force; :class:`LearnedDecoder` runs the model with
NumPy alone. :class:`ProportionalDecoder` is the plain baseline. In a run they are chosen by name, see
``docs/evidence/emg-decoders.md``.
"""

from tega.stages.learned.features import FEATURES
from tega.stages.learned.learned import Decoded, LearnedDecoder
from tega.stages.learned.model import Model, load_model, save_model
from tega.stages.learned.proportional import ProportionalDecoder
from tega.stages.learned.training import fit

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
