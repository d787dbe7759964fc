"""How wrong a robot is about its own place, in numbers."""

import dataclasses as dc


@dc.dataclass
class PoseEstimateConfig:
    """The error of the pose estimate; by default there is none."""

    # Standard deviation of each estimate, fresh every period: metres and degrees.
    position_noise: float = 0.0
    yaw_noise_degrees: float = 0.0
    # Standard deviation to which a random walk has grown after 30 minutes of motion: metres along
    # each axis, and degrees; the paper's humanoid drifts 0.02 m.
    position_drift: float = 0.0
    yaw_drift_degrees: float = 0.0
    # Seconds between two estimates.
    period: float = 0.05

    @property
    def exact(self) -> bool:
        """Whether the estimate is the truth."""
        return not (
            self.position_noise
            or self.yaw_noise_degrees
            or self.position_drift
            or self.yaw_drift_degrees
        )
