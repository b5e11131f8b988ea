"""Fitting basic models to views: one loop, its losses, densification, and the three phases as data."""
