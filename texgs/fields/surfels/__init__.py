"""What can be fitted to views and drawn: surfels."""
