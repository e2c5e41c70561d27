"""Where the fingertips' pads meet a held object, and the closure poses designed so that they do."""
