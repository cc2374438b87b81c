"""Edits of a block: a reviewed YAML file that switches off, renumbers, exchanges or reweights what was measured."""
