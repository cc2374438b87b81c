"""Compiled relative orientation: pair by pair."""
