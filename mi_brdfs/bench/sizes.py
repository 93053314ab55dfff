"""The sizes of the measurements. On two idle cores, everything takes about ten minutes."""

ANGLES = 5, 30, 60, 80
"""Angles of incidence, in degrees."""
AZIMUTHS = 0, 45, 90
"""Azimuths at which anisotropic parts are measured; the least efficiency counts."""
LOG2_POINTS = 13
"""log₂ of the number of points per direction, in each of their shifted copies: efficiencies are accurate to 0.001."""

PICTURE = 128
"""Width and height of the sphere's pictures; those of the Cornell box have half."""
SPP = 64
PAIRS = 15
"""Pairs of pictures, of our BSDF and of the built-in."""
RESAMPLINGS = 2000
"""Bootstrap resamplings of the pictures, for the interval of time × variance."""

FIRST_PAIRS = 6
"""Pairs of fresh processes, for our BSDF and for the built-in."""
FIRST_ALL_PAIRS = 3
"""The same for the scene of all models."""

CYCLES = 300
"""The least number of scenes to load, render and discard."""
EDGE = 50
"""The least number of these, at the beginning and at the end, to compare."""

SCALAR_PICTURE = 16
SCALAR_SPP = 32
SCALAR_PAIRS = 5
