"""DBAT projects: reader."""
