"""Write the passes of Stockham's algorithm for a complex Fourier transform, as text.

A pass of radix r transforms x to y, for a length that has already been split by s:

    y[q + s (r p + k)] = e^{2 pi i p k / (r m)} sum_{j<r} x[q + s (p + m j)] e^{2 pi i j k / r}
                         p < m, q < s

(Van Loan 1992, section 1.7). No bit reversal is needed, and as the rows q and their lanes are
contiguous, the inner loop runs over s W numbers. Real parts fill the first half of an array,
imaginary parts the second half.

A band-limited series has only B = n / r frequencies that are not zero, from -B / 2 to below B / 2.
In the pass of radix r each sum then has one term, where f is the frequency of row p:

    y[r p + k] = e^{2 pi i f k / n} x[p]                                      p < B, k < r
"""

from __future__ import annotations

from cmath import exp
from math import cos, pi, sin
from typing import NamedTuple

# The largest radix with unrolled sums; a larger prime takes r^2 steps in a loop
WRITTEN_OUT = 13

PASS = """
for p in range({m}):
    {turns}
    for e in range({inner}):
        i, o = p * {inner} + e, p * {r} * {inner} + e
        {lines}
"""

LARGE_PASS = """
for p in range({m}):
    for k in range({r}):
        o = (p * {r} + k) * {inner}
        {y}[o : o + {inner}] = 0
        {y}[{size} + o : {size} + o + {inner}] = 0
        for j in range({r}):
            turn = {first} + k * (p + {m} * j) % ({r} * {m})
            cos, sin = turns[turn, 0], turns[turn, 1]
            for e in range({inner}):
                re, im = {x}[(p + {m} * j) * {inner} + e], {x}[{size} + (p + {m} * j) * {inner} + e]
                {y}[o + e] += re * cos - im * sin
                {y}[{size} + o + e] += re * sin + im * cos
"""


BAND_PASS = """
for p in range({m}):
    {turns}
    for e in range({inner}):
        i, o = p * {inner} + e, p * {r} * {inner} + e
        r0 = x[i]; i0 = x[i + {m} * {inner}]
        {lines}
"""


class Pass(NamedTuple):
    """The parameters of one pass."""

    r: int  # radix
    m: int  # remaining length after the pass
    inner: int  # number of contiguous numbers
    size: int  # index of the imaginary parts
    first: int  # index of the pass's first twiddle factor
    x: str  # name of the input array
    y: str  # name of the output array


def passes(n: int, lanes: int, band: int) -> tuple[str, str, list[complex]]:
    """Return the text of all passes, which go from an array x to an array y and back.

    Args:
        n: length of the transform.
        lanes: number of transforms side by side.
        band: B, the number of frequencies in x, a divisor of n; n: all of them.

    Returns:
        The text, the name of the array with the result, and the twiddle factors.
    """
    text = ""
    turns: list[complex] = []
    x, y = "x", "y"
    s, m = 1, n
    if band < n:
        r = n // band
        one = Pass(r=r, m=band, inner=lanes, size=n * lanes, first=0, x=x, y=y)
        lines = ("\n" + 8 * " ").join(_stores(one, ["r0"] * r, ["i0"] * r))
        text += BAND_PASS.format(**one._asdict(), turns=_turns(one), lines=lines)
        turns += [exp(2j * pi * f * k / n) for f in frequencies(band) for k in range(1, r)]
        s, m = r, band
        x, y = y, x
    for r in radices(m):
        m //= r
        one = Pass(r=r, m=m, inner=s * lanes, size=n * lanes, first=len(turns), x=x, y=y)
        if r <= WRITTEN_OUT:
            lines = ("\n" + 8 * " ").join(_lines(one))
            text += PASS.format(**one._asdict(), turns=_turns(one), lines=lines)
            turns += [exp(2j * pi * p * k / (r * m)) for p in range(m) for k in range(1, r)]
        else:
            text += LARGE_PASS.format(**one._asdict())
            turns += [exp(2j * pi * k / (r * m)) for k in range(r * m)]
        s *= r
        x, y = y, x
    return text, x, turns


def narrowest_band(n: int, highest: int) -> int:
    """Return the least number of frequencies from which a transform of length n can start.

    Args:
        n: length of the transform.
        highest: the highest frequency that is not zero, at most n / 2.

    Returns:
        B, a divisor of n above 2 `highest`; n if there is none.
    """
    factors = [r for r in range(1, WRITTEN_OUT + 1) if n % r == 0 and n // r > 2 * highest]
    return n // max(factors, default=1)


def frequencies(band: int) -> list[int]:
    """Return the frequencies of the rows of a band: from 0 up, then the negative ones up to -1."""
    return [p if 2 * p < band else p - band for p in range(band)]


def fast_length(n: int) -> int:
    """Return the smallest length of at least n whose passes are all unrolled."""
    while max(radices(n), default=1) > WRITTEN_OUT:
        n += 1
    return n


def radices(n: int) -> list[int]:
    """Return the prime factors of n, largest first, with pairs of twos merged to fours."""
    primes = []
    d = 2
    while n > 1:
        if n % d:
            d += 1
        else:
            primes.append(d)
            n //= d
    twos = primes.count(2)
    odd = [p for p in primes if p > 2]
    return sorted([4] * (twos // 2) + [2] * (twos % 2) + odd, reverse=True)


def _turns(one: Pass) -> str:
    """Return the line that loads the factors of p: `c1, s1 = turns[0 + 3 * p + 0, 0], ...`."""
    if one.m == 1:
        return "pass"  # the last pass has no twiddle factors
    loads = []
    for k in range(1, one.r):
        at = f"{one.first} + {one.r - 1} * p + {k - 1}"
        loads.append(f"c{k}, s{k} = turns[{at}, 0], turns[{at}, 1]")
    return "; ".join(loads)


def _lines(one: Pass) -> list[str]:
    """Return the lines that load r_j and i_j, sum them to R_k and I_k, and store these."""
    r, m, inner, size = one.r, one.m, one.inner, one.size
    loads = []
    for j in range(r):
        real = f"r{j} = {one.x}[i + {j * m * inner}]"
        imaginary = f"i{j} = {one.x}[i + {j * m * inner + size}]"
        loads.append(f"{real}; {imaginary}")
    sums = SUMS[r] if r in SUMS else _odd_sums(r)
    stores = _stores(one, [f"R{k}" for k in range(r)], [f"I{k}" for k in range(r)])
    return [*loads, *sums, *stores]


def _stores(one: Pass, real: list[str], imaginary: list[str]) -> list[str]:
    """Return the lines that rotate r numbers, given their names, and store them."""
    stores = [f"{one.y}[o] = {real[0]}; {one.y}[o + {one.size}] = {imaginary[0]}"]
    for k in range(1, one.r):
        re, im = real[k], imaginary[k]
        if one.m > 1:
            re, im = f"{re} * c{k} - {im} * s{k}", f"{re} * s{k} + {im} * c{k}"
        at = f"o + {k * one.inner}"
        stores.append(f"{one.y}[{at}] = {re}; {one.y}[{at} + {one.size}] = {im}")
    return stores


# R_k + i I_k = sum_{j<r} (r_j + i i_j) e^{2 pi i j k / r}
SUMS = {
    2: ["R0 = r0 + r1; I0 = i0 + i1; R1 = r0 - r1; I1 = i0 - i1"],
    4: [
        "ar = r0 + r2; ai = i0 + i2; br = r0 - r2; bi = i0 - i2",
        "cr = r1 + r3; ci = i1 + i3; dr = r1 - r3; di = i1 - i3",
        "R0 = ar + cr; I0 = ai + ci; R2 = ar - cr; I2 = ai - ci",
        "R1 = br - di; I1 = bi + dr; R3 = br + di; I3 = bi - dr",
    ],
}


def _odd_sums(r: int) -> list[str]:
    """Return the lines that compute the sums of an odd radix.

    The terms j and r - j share their products: the sums a_j are multiplied by the cosine, and the
    differences b_j by the sine.
    """
    half = range(1, (r + 1) // 2)
    lines = [
        f"a{c}{j} = {c}{j} + {c}{r - j}; b{c}{j} = {c}{j} - {c}{r - j}" for c in "ri" for j in half
    ]
    lines += [f"{c.upper()}0 = {c}0 + " + " + ".join(f"a{c}{j}" for j in half) for c in "ri"]
    for k in half:
        angle = {j: 2 * pi * j * k / r for j in half}
        for c in "ri":
            lines.append(
                f"e{c} = {c}0 + " + " + ".join(f"F({cos(angle[j])!r}) * a{c}{j}" for j in half)
            )
            lines.append(f"d{c} = " + " + ".join(f"F({sin(angle[j])!r}) * b{c}{j}" for j in half))
        lines.append(f"R{k} = er - di; I{k} = ei + dr; R{r - k} = er + di; I{r - k} = ei - dr")
    return lines
