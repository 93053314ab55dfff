"""What the workers of the tests do."""

import os
import time

import mitsuba as mi
import numpy as np


def work(number):
    """Take a moment, and say who did it."""
    time.sleep(0.3)
    if number == 3:
        raise ValueError("3 is not a number that I like")
    return number, mi.variant(), os.getpid()


def powers(base, number):
    """Return an array that depends on the task alone."""
    return base ** np.random.default_rng(number).uniform(size=4)


def last_breath(folder, deaths):
    """End the worker, unless so many have died of it."""
    died = len(os.listdir(folder))
    if died < deaths:
        open(os.path.join(folder, str(died)), "w").close()
        os.kill(os.getpid(), 9)
    return "alive"


def ends_at_three(number):
    """Return what is given; of 3 the process ends."""
    if number == 3:
        os._exit(3)
    return number
