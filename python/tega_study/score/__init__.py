"""Score a study's trials: gather several accounts of each trial, and measure their agreement."""
