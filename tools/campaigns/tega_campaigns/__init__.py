"""Run campaigns of faults against TEGA on emulated devices: soak, stress, kills, faults of devices and of stations."""
