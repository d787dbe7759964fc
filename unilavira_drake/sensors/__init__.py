"""Sensors: cameras, detections and the panorama."""
