"""What a run takes in: streams of stamped items, the threads that read devices, and what is measured on the way."""
