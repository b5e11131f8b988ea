"""Ways to give a scene a new look: a module each. texgs/config/methods.py finds those that define METHOD."""
