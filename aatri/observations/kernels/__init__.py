"""Compiled lanes of the observation types."""
