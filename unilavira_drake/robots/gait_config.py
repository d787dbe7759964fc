"""The sway of a walking body in numbers."""

import dataclasses as dc


@dc.dataclass
class Gait:
    """How the trunk and the legs swing at full speed; the trunk is still at rest."""

    # Full cycles (two steps) a second at full speed.
    frequency: float = 2.0
    # Amplitude of the trunk's rise and fall, metres; twice a cycle.
    heave: float = 0.01
    # Amplitudes of the trunk's roll (once a cycle) and pitch (twice a cycle), degrees.
    roll_degrees: float = 2.0
    pitch_degrees: float = 1.0
    # Amplitude of the legs' swing to and fro, degrees.
    swing_degrees: float = 20.0
