"""Look at the tables of a stranger's log and propose how to read them, each part with its reason."""

from .policy import ProposalPolicy
from .propose import propose
from .values import Confidence, Item, Problem, Proposal

__all__ = ["Confidence", "Item", "Problem", "Proposal", "ProposalPolicy", "propose"]
