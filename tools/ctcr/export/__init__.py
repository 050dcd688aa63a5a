"""A robot for other programs."""

from ctcr.export.cpp_header import cpp_header

__all__ = ["cpp_header"]
