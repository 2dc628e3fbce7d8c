"""What makes a drive less than ideal: noise, latency, boot time, a clock that drifts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["NOISES", "Imperfections"]

NOISES = ("velocity_noise", "current_noise", "position_noise")
#: The generator's state has 48 bits, and 0 is not a valid seed.
_SEEDS = 1 << 47


@dataclass(frozen=True, slots=True)
class Imperfections:
    """Imperfections of one drive, 0 for none. Noise in the axis record's units; ``drift`` is a ratio, 1e-6 is 1 ppm."""

    velocity_noise: float = 0.0
    current_noise: float = 0.0
    position_noise: float = 0.0
    latency_ns: tuple[int, int] = (0, 0)
    answer_ns: int = 0
    ready_ns: int = 0
    drift: float = 0.0
    seed: int = 0

    def apply(self, axis: Any) -> None:
        """Write them into an axis record, over the model's values."""
        axis.measurement.settings.velocity_noise = self.velocity_noise
        axis.measurement.settings.current_noise = self.current_noise
        axis.measurement.settings.position_noise = self.position_noise
        axis.measurement.settings.seed = self.seed % _SEEDS + 1 if any(getattr(self, name) for name in NOISES) else 0
        axis.clock.settings.drift = self.drift
        if self.ready_ns:
            axis.boot_time_ns = self.ready_ns

    def latency(self) -> Callable[[], int] | None:
        """How long the drive works on each request in turn, ns; None for no latency."""
        least, most = self.latency_ns
        if not most:
            return None
        random = SplitMix64(self.seed + 1)
        return lambda: least + int(random.uniform() * (most - least + 1))

    def shown(self) -> dict[str, float | list[float]]:
        """The imperfections that are set, for display."""
        found: dict[str, float | list[float]] = {
            "velocity_noise_rpm": self.velocity_noise,
            "current_noise_amperes": self.current_noise,
            "position_noise_revolutions": self.position_noise,
            "parameter_latency_seconds": [end / 1e9 for end in self.latency_ns] if self.latency_ns[1] else 0.0,
            "answers_after_seconds": self.answer_ns / 1e9,
            "ready_after_seconds": self.ready_ns / 1e9,
            "clock_drift_ppm": self.drift * 1e6,
        }
        return {key: value for key, value in found.items() if value}
