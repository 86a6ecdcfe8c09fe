"""One motion of all arms, from a plan of one action after the other.

The path bound finds motions in which one arm moves at a time and comes home in between. Here the
same contacts are made in less time: fingers move on the way, arms go straight on where nothing is
in between, all arms move at once where they are clear of each other, and jerk is limited. Whatever
comes of it passes the same verification.
"""

from guided_lgp.bounds.coordination.coordinate import Coordinator

__all__ = ["Coordinator"]
