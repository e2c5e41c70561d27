"""Count the fingers that hold: a feature of TEGA in a package of its own."""
