"""`python -m experiments.blind_trials`: the same as `furuta trials`."""

import sys

from experiments.cli import main

if __name__ == "__main__":
    sys.argv.insert(1, "trials")
    main()
