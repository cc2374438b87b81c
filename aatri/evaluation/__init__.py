"""Accuracy figures: control, check points, truth."""
