"""Recording: transcript, results and pictures of a run."""
