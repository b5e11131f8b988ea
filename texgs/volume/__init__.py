"""Scalar volumes: files of many formats, prepared once into one canonical file, opened as a grid."""
