"""Scenes in a browser: what the page of a viewer and the page of an export have in common."""
