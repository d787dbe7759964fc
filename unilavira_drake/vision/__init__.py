"""Vision action: the grounding model chooses where (paper III-B.2)."""
