"""Compiled joining of models."""
