"""Compare touch readings on recorded sets whose truth is known, all of them on the same frames in one run."""
