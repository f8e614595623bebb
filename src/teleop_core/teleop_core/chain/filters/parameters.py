"""Parameters of the tremor filter."""

from dataclasses import dataclass, field

from teleop_core.base.parameters import Choice, choice, parameter
from teleop_core.chain.filters import TREMOR_FILTERS
from teleop_core.chain.mapping.plausibility import HandLimits


@dataclass(frozen=True, kw_only=True)
class TremorFilterParameters:
    """Parameters of :class:`~teleop_core.chain.filters.tremor_filter.RunningTremorFilter`."""

    kind: Choice = choice(TREMOR_FILTERS, "band_stop", doc="how tremor is taken out")
    longest_pause: float = parameter(
        0.3, unit="s", lower=0.002, upper=5.0,
        doc="after a longer pause of the master the filter begins anew at the reading",
    )  # fmt: skip
    plausible: HandLimits = field(default_factory=HandLimits)
