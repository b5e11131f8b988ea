"""Ways to give a scene a new look: a module each. texgs/edit/method.py finds those that define METHOD."""
