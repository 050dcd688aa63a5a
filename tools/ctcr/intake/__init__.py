"""Logs of other laboratories and other programs, turned into tables of measurements."""
