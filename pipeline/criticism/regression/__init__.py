"""Weighted least squares over all segments: linear system, Gauss-Newton, noise floors."""
