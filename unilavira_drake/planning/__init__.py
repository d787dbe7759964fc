"""Planning: from an occupancy map and a goal to a path on free floor."""
