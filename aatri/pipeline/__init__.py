"""Spec, graph, registry, store and runner; knows no photogrammetry."""
