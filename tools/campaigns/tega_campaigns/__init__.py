"""Run campaigns of faults against TEGA on emulated devices: soak, kills, faults of devices and of stations."""
