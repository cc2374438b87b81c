"""Pix4D's folder of parameters."""
