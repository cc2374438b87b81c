"""Resection of single images."""
