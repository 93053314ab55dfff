"""How much is measured. On two cores that are not busy, everything takes about ten minutes."""

ANGLES = 5, 30, 60, 80
"""Of incidence, in degrees."""
AZIMUTHS = 0, 45, 90
"""At which anisotropic parts are looked at; the least efficiency counts."""
LOG2_POINTS = 13
"""Of the points of a direction, in each of their shifted copies: an efficiency is good to 0.001."""

PICTURE = 128
"""Width and height of the sphere's pictures; the Cornell box has half of it."""
SPP = 64
PAIRS = 15
"""Pictures of ours and of the built-in, in turn."""
RESAMPLINGS = 2000
"""Of the pictures, for the interval of time × variance."""

FIRST_PAIRS = 6
"""Fresh processes for ours and for the built-in, in turn."""
FIRST_ALL_PAIRS = 3
"""The same for the scene of all models."""

CYCLES = 300
"""Scenes loaded, rendered and discarded, at least."""
EDGE = 50
"""Of these, how many at the beginning and at the end are compared, at least."""

SCALAR_PICTURE = 16
SCALAR_SPP = 32
SCALAR_PAIRS = 5
