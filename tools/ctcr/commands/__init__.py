"""One module per subcommand; each exposes `command`. Heavy imports stay inside the functions."""
