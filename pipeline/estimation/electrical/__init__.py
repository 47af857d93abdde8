"""Resistance, inductance and flux: what the estimators of the terminals share."""
