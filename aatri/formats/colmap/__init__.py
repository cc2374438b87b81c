"""COLMAP models, text and binary: reader and writer."""
