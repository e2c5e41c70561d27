"""Read and write files safely: foreign files, whole files, locks, plain names, CSV and TOML."""
