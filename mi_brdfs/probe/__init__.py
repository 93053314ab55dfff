"""What every measurement of a BSDF stands on: its calls as NumPy arrays, directions, variates, histograms.

Private: checks, benchmarks, plots and tests are built on this package, which imports none of them.
"""
