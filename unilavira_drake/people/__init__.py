"""People who walk about: moving obstacles that cross the robot's way."""
