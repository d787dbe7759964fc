"""Mapping: from depth and pixels to a map and a goal."""
