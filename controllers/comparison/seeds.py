"""Where seeds of judging begin, so that no training meets what it is judged on.

Episode or rig i of a batch with seed s has the seed s + i: equal seeds are equal rigs, starts and noise.
"""

OTHER_SEED = 1_000_000  # episodes that choose a network are not those that train it
FINAL_SEED = 2_000_000  # and those that judge the chosen one are new again
BUILT_SEED = 3_000_000  # of rigs that could be built: a training from the same seed draws its episodes from seed + i
_APART = 10_000  # between two seeds of judging: more than a batch has rigs
RESUMED_SEED = 10_000_000  # of a finished policy that goes on: plus its steps, this is beyond all of the above


def judging(first: int, seed: int) -> int:
    """The seed of a batch that judges, so that neighbouring seeds, below 100, have no rig in common. first: one of the
    above."""
    return first + _APART * seed
