"""Look at the tables of a stranger's log and propose how to read them, each part with its reason."""

from .items import AFTER_UNITS
from .policy import ProposalPolicy
from .propose import propose
from .values import Confidence, Item, Problem, Proposal

__all__ = ["AFTER_UNITS", "Confidence", "Item", "Problem", "Proposal", "ProposalPolicy", "propose"]
