"""Where the fingertips' pads meet a held object."""
