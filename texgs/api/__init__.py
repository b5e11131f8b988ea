"""The Python interface: volumes and scenes as objects that show themselves in notebooks."""
