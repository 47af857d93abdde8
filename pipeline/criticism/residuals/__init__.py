"""Segments of a campaign and their residuals, whatever the kind of test."""
