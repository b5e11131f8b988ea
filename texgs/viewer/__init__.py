"""Scenes in a browser: a server that renders and edits them, and the page that it serves."""

PAGE_VOLUME = 1.6  # MB of the volume in a page, by default
