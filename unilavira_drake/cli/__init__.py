"""The command ``unilavira``."""
