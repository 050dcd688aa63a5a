"""Which physical effect is missing: data audit, calibration, stepwise selection of effects, validation, verdict."""

from ctcr.diagnose.pipeline import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
