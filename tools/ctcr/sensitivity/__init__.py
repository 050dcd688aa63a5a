"""Influence of wrong parameters on the predicted tip and on the tracking error: which of them deserve calibration."""
