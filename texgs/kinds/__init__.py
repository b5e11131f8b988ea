"""Kinds of field: a module each. texgs/config/fields.py finds those that define FIELD."""
