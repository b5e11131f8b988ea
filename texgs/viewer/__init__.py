"""Scenes in a browser: a server that renders and edits them, and the page that it serves."""
