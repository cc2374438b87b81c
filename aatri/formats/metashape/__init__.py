"""Agisoft Metashape and PhotoScan: cameras and markers XML, and the document of a .psz."""
