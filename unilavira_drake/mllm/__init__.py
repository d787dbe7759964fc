"""The model layer: requests, replies and the backends that answer them.  No pydrake here."""
