"""Compiled parts of the adjustment: graph, elimination, assembly, covariance."""
