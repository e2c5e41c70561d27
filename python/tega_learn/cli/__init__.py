"""Commands for learned decoders."""
