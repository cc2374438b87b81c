"""Artifacts on disk: objects, records, pointers, locks, durable writes."""
