"""Compiled ties."""
