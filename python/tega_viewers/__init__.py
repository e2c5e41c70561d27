"""Stream a run to Rerun or Foxglove while it goes on."""
