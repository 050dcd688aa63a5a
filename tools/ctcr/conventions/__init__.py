"""Conventions before physics: which columns or frames follow another convention than the format says."""

from ctcr.conventions.finding import Finding
from ctcr.conventions.review import Review, review

__all__ = ["Finding", "Review", "review"]
