"""Language action: the large model chooses what to do (paper III-B.1)."""
