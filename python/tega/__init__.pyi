from tega import config as config
from tega import devices as devices
from tega import emg as emg
from tega import errors as errors
from tega import hand as hand
from tega import haptics as haptics
from tega import loop as loop
from tega import plot as plot
from tega import records as records
from tega import stages as stages
from tega import tactile as tactile
from tega import wire as wire
from tega.loop.program import session as session
from tega.recording.opened import open_recording as open_recording

__version__: str
__all__ = [
    "__version__",
    "config",
    "devices",
    "emg",
    "errors",
    "hand",
    "haptics",
    "loop",
    "open_recording",
    "plot",
    "records",
    "session",
    "stages",
    "tactile",
    "wire",
]
