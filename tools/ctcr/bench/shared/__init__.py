"""Shared by devices and simulators: their protocols, the folder where their processes meet, priorities."""
