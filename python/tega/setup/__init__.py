"""Set up a lab: guided calibration and the check of every device."""
