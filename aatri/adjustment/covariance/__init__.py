"""Exact covariances: marginal ones by going back down the tree, pairs by solves, constraints and datum."""
