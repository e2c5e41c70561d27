"""Track the forearm by a HoloLens 2 or by whatever an OpenXR runtime tracks: drivers that the core does not know."""
