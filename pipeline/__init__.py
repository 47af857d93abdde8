"""Recordings of motor test benches in, trusted motor datasheets out."""

__version__ = "0.1.0"
