"""Worlds under the open sky: ground, buildings, plants and vehicles."""
