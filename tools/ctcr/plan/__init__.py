"""What to measure next, to tell apart what the measurements so far cannot."""

from ctcr.plan.proposal import Proposal, propose

__all__ = ["Proposal", "propose"]
