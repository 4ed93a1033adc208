"""Normal random numbers by counting, not by a generator with a state: the same for every batch and backend.

The number of a seed s, a stream k and a time t, all whole numbers modulo 2^64, is

    a = mix(mix(s + G) ^ (k * M))            G = 0x9E3779B97F4A7C15, M = 0xD1342543DE82EF95
    b = mix(a + (t + 1) * G)
    c = mix(b ^ 0xD6E8FEB86659FD93)
    u = ((b >> 11) + 1) / 2^53               in (0, 1]
    v = (c >> 11) / 2^53                     in [0, 1)
    normal = sqrt(-2 log(u)) cos(2 pi v)     (Box and Muller 1958)

with the finaliser of splitmix64 (Steele, Lea and Flood 2014, variant 13 of Stafford):

    mix(z):  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9
             z = (z ^ (z >> 27)) * 0x94D049BB133111EB
             z ^ (z >> 31)

All of it up to b, c, u and v is the same to the last bit everywhere; `log` and `cos` are the library's.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.engine.operations import FloatArray

Words: TypeAlias = npt.NDArray[np.uint64]

_GAMMA = np.uint64(0x9E3779B97F4A7C15)
_STREAM = np.uint64(0xD1342543DE82EF95)
_SECOND = np.uint64(0xD6E8FEB86659FD93)
_FACTORS = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_MANTISSA = np.uint64(11)
_UNIT = 2.0**-53


class NormalNumbers:
    """Draws for fixed seeds and streams, one array a time, in arrays of its own.

    Attributes:
        values: What was drawn last, shape (n_streams, B).
    """

    def __init__(self, streams: npt.NDArray[np.int32], batch: int) -> None:
        self._streams = streams.astype(np.uint64)[:, np.newaxis] * _STREAM
        shape = (len(streams), batch)
        self._keys: Words = np.zeros(shape, np.uint64)
        self._words: Words = np.zeros(shape, np.uint64)
        self._spare: Words = np.zeros(shape, np.uint64)
        self.values: FloatArray = np.zeros(shape)
        self._angles: FloatArray = np.zeros(shape)
        self.seed(np.zeros(batch, np.uint64))

    def seed(self, seeds: Words) -> None:
        """Take the seed of every member of the batch, shape (B,)."""
        first = np.add(seeds, _GAMMA)[np.newaxis]
        _mix(first, np.empty_like(first))
        np.bitwise_xor(self._streams, first, out=self._keys)
        _mix(self._keys, self._spare)

    def draw(self, time: int) -> None:
        """Put the numbers of this time into `values`."""
        step = np.uint64((time + 1) * int(_GAMMA) & 0xFFFF_FFFF_FFFF_FFFF)
        words, spare = self._words, self._spare
        np.add(self._keys, step, out=words)
        _mix(words, spare)
        np.right_shift(words, _MANTISSA, out=spare)
        np.add(spare, np.uint64(1), out=spare)
        np.copyto(self.values, spare, casting="unsafe")  # exact: at most 2^53
        np.multiply(self.values, _UNIT, out=self.values)
        np.log(self.values, out=self.values)
        np.multiply(self.values, -2.0, out=self.values)
        np.sqrt(self.values, out=self.values)
        np.bitwise_xor(words, _SECOND, out=words)
        _mix(words, spare)
        np.right_shift(words, _MANTISSA, out=words)
        np.copyto(self._angles, words, casting="unsafe")
        np.multiply(self._angles, _UNIT, out=self._angles)
        np.multiply(self._angles, 2.0 * np.pi, out=self._angles)
        np.cos(self._angles, out=self._angles)
        np.multiply(self.values, self._angles, out=self.values)


def _mix(words: Words, spare: Words) -> None:
    """Do the finaliser, in place."""
    for shift, factor in zip(_SHIFTS, _FACTORS, strict=False):
        np.right_shift(words, shift, out=spare)
        np.bitwise_xor(words, spare, out=words)
        np.multiply(words, factor, out=words)
    np.right_shift(words, _SHIFTS[2], out=spare)
    np.bitwise_xor(words, spare, out=words)
