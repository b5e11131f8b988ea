"""Basic models: surfels with shading and texture, how they look in a view, and their files."""
