"""How a camera chooses its exposure."""

import dataclasses as dc

EXPOSURES = ("fixed", "auto", "locked")


@dc.dataclass
class ExposureConfig:
    """The gain of the colour images."""

    # fixed: as rendered. auto: each picture has its own, so a colour depends on what else is in
    # view. locked: that of the first front picture, for all views of the episode.
    mode: str = "fixed"
    # Mean luminance that auto and locked aim at, as a share of white in linear light.
    target: float = 0.35
