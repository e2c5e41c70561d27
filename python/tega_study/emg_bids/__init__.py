"""Write the muscle signals of a study as a BIDS data set of modality EMG."""
