"""Scenes: files, the session that edits them, frames, meshes and exports."""
