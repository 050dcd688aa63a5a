"""The robot description: its file, its units, its checks and the ledger of its changes."""
