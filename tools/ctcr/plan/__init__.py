"""Further measurements that tell apart explanations which the present ones cannot."""

from ctcr.plan.proposal import Proposal, propose

__all__ = ["Proposal", "propose"]
