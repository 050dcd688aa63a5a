"""What devices and simulators share: their protocols, the folder where their processes meet, priorities."""
