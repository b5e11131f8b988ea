"""Configuration: typed schema, composition, digests. Light: no torch, no numpy."""
