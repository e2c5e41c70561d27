"""Track the forearm by whatever an OpenXR runtime tracks: the driver ``openxr``."""
