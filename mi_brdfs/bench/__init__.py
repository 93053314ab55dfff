"""Compare the noise and the cost of any two BSDFs: ``compare("walter", {"type": "roughconductor"})``."""

from .comparison import Comparison, Measurement, compare

__all__ = ["Comparison", "Measurement", "compare"]
