"""Robots: one module and one SDF each, and the controllers they share."""
