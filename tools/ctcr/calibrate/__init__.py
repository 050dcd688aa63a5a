"""Calibration of a robot: the procedures that measure one thing at a time, and the joint fit to pose measurements."""
