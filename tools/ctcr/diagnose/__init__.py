"""Which physical effect is missing: data audit, calibration, the race of all candidates, validation, verdict."""

from ctcr.diagnose.analysis import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
