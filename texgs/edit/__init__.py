"""Edits that make a new look: by pictures, by words, and only where the user points."""
