"""What a rounded reading says of the angle behind it: straight-line arithmetic, so that many filters go side by side.

The angle lies in a cell of the encoder's width around the reading (Curry 1970, "Gaussian fit").
"""

import math

from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.elementary import exp, fma

_ROOT_HALF = math.sqrt(0.5)
_ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
_NARROW = 0.04  # of a prediction's variance: a cell with less than that as its width squared is narrow


@compiled(forceinline=True)
def erfcx(x: float) -> float:
    """exp(x²) erfc(x) for x ≥ 0; relative error below 2e-15.

    (1 + 2x) times that, as a polynomial in (x − 15/4)/(x + 15/4) (the form is Shepherd and Laframboise's, 1981; the
    coefficients are Chebyshev's, computed to 60 digits).
    """
    t = (x - 3.75) / (x + 3.75)
    t2 = t * t
    t4 = t2 * t2
    t8 = t4 * t4
    a = fma(
        t4,
        fma(t2, fma(t, 0.02836227737211114, -0.05869339857664934), fma(t, 0.09230432116428125, -0.10880393014244462)),
        fma(t2, fma(t, 0.08227673848999506, 0.0035854154854790257), fma(t, -0.14024059858554525, 1.2375126308378275)),
    )
    b = fma(
        t4,
        fma(
            t2,
            fma(t, -9.792625707303523e-07, -1.1438048033346894e-05),
            fma(t, 2.2387565714911816e-05, 5.164652974177416e-05),
        ),
        fma(
            t2,
            fma(t, -0.00029015535246077655, 0.000293714378044958),
            fma(t, 0.0017556261651970652, -0.009746579683265262),
        ),
    )
    c = fma(
        t4,
        fma(t2, -2.623107347133476e-09, fma(t, -1.9551358868985616e-09, 3.197926671666804e-08)),
        fma(
            t2,
            fma(t, 1.879082322370048e-08, -2.4857126248016745e-07),
            fma(t, -5.084465378687302e-08, 1.7419821586224816e-06),
        ),
    )
    s = fma(t8, fma(t8, c, b), a)
    return s / (1.0 + 2.0 * x)


@compiled(forceinline=True)
def cell(d, v, step):
    """(e, S, q, factor): a reading d beyond its prediction, of variance v, rounded to multiples of `step`.

    e and S are the innovation and its variance of the Gaussian reading that would leave the same mean and variance as
    the cell does; for step → 0 that is d and v. −log of the cell's probability over its width, less ½ log 2π, is
    ½ q + log factor.
    """
    s = math.sqrt(v)
    a, b = (abs(d) - 0.5 * step) / s, (abs(d) + 0.5 * step) / s
    # everything over φ(m), or it vanishes far out in the tail
    m = a if a > 0.0 else 0.0
    below = -0.5 * (a * a - m * m)
    beyond = -0.5 * (b * b - m * m)
    at_a = exp(below if below > -700.0 else -700.0)
    at_b = exp(beyond if beyond > -700.0 else -700.0)
    tail_a = 0.5 * at_a * erfcx(abs(a) * _ROOT_HALF)
    tail_b = 0.5 * at_b * erfcx(b * _ROOT_HALF)
    inside = tail_a - tail_b if a > 0.0 else 1.0 - tail_a - tail_b
    density = inside * _ROOT_TWO_PI
    mean = (at_a - at_b) / density
    kept = 1.0 + (a * at_a - b * at_b) / density - mean * mean  # of the variance
    kept = 0.0 if kept < 0.0 else kept
    kept = 1.0 - 1e-9 if kept > 1.0 - 1e-9 else kept
    S = v / (1.0 - kept)
    e = (mean if d >= 0.0 else -mean) * S / s
    # a cell narrow against the prediction: its width is a variance (Sheppard)
    narrow = step * step < _NARROW * v
    wide = v + step * step / 12.0
    return (
        d if narrow else e,
        wide if narrow else S,
        d * d / wide if narrow else m * m,
        math.sqrt(wide) if narrow else step / density,
    )


@compiled(nogil=True)
def counted(d, v, step):
    """(e, S, cost) of one reading, by `cell`."""
    e, S, q, factor = cell(d, v, step)
    return e, S, 0.5 * q + math.log(factor)
