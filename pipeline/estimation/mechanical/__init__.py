"""Torque, inertia and drag: what the estimators of the shaft share."""
