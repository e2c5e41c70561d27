"""Exchange markers with other programs, the run's and theirs, by the Lab Streaming Layer."""
