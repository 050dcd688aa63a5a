"""What wrong parameters do to the predicted tip and to the tracking error, and which of them deserve calibration."""
