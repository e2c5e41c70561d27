"""Take episodes outside of studies: recordings that a person starts, keeps, discards or does again."""
