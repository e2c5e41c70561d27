"""How long a vest's motor takes to start, measured with a microphone."""
