"""The integrators, one file each."""
