"""Memory: the TODO list (TDM) and the waypoints (SCB)."""
