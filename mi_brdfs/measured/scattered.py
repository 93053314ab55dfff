from .measurement import Grid


def gridded(data):
    assert isinstance(data, Grid)
    return data
