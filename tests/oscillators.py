"""Matsuoka's equations written once more, solved by scipy, for the tests of the oscillators."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp


def solved(weights, *, tau, adaptation, b, drive, start, duration_s):
    """tau x' = c - x - b v - W max(0, x); T v' = max(0, x) - v, by DOP853; the states (x, v) over time.

    Args:
        weights: W, inhibition is positive; shape (n, n).
        tau: tau, [s].
        adaptation: T, [s].
        b: Strength of the adaptation.
        drive: c.
        start: x and v at the start; shape (2 n,).
        duration_s: How long.
    """
    n = len(weights)

    def change(_, state):
        rate = np.maximum(state[:n], 0)
        x_change = (drive - state[:n] - b * state[n:] - weights @ rate) / tau
        return np.concatenate([x_change, (rate - state[n:]) / adaptation])

    span = (0.0, duration_s)
    return solve_ivp(
        change, span, start, "DOP853", dense_output=True, rtol=1e-10, atol=1e-12, max_step=tau / 4
    ).sol


def published_frequency(a, *, tau, adaptation, b):
    """Matsuoka 2011: omega = 1/T sqrt(((tau + T) b - tau a) / (tau a)), as [Hz].

    With y = K x for the oscillation, a mode of inhibition a has tau x' = (a K - 1) x - b v, T v' = K x - v.
    It neither grows nor shrinks for a K = 1 + tau / T; then omega^2 = (b K - tau / T) / (tau T).
    """
    return math.sqrt(((tau + adaptation) * b - tau * a) / (tau * a)) / adaptation / (2 * math.pi)


def frequency(time_s, signal):
    """Of a periodic signal, from where it rises through zero, interpolated, [Hz]."""
    before = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    part = signal[before] / (signal[before] - signal[before + 1])
    crossings = time_s[before] + part * (time_s[1] - time_s[0])
    return (len(crossings) - 1) / (crossings[-1] - crossings[0])
