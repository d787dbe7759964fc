"""Converts furniture libraries (``.sh3f``) into glTF models with a catalogue and attribution."""
