"""Worlds: what stands where, and how it becomes geometry."""
