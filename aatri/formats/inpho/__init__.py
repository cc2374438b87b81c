"""Inpho: projects of Match-AT (.prj)."""
