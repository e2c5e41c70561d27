"""Commands of the link between two stations."""
