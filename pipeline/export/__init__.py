"""Datasheets as other programs read them; one exporter a file."""
