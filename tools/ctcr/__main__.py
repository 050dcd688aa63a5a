"""`python -m ctcr` is the `ctcr` command."""

from ctcr.cli import main

main()
