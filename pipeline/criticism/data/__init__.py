"""Captures as the signals that equations need: even clocks, sensor noise, the machine's scale."""
