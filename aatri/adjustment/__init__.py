"""Least squares and nothing else."""
