"""Predictions: parameters, single poses, recordings in order, and simulated measurements."""

from ctcr.model.model import Model, Prediction, Shape, status_text

__all__ = ["Model", "Prediction", "Shape", "status_text"]
