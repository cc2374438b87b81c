"""Compiled resection."""
