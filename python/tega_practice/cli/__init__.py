"""Commands for practice: Fitts tests and vest lessons."""
