"""Sparse models of VisualSFM (NVM) and Bundler."""
