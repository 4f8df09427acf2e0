"""`python -m controllers.policies FOLDER`: learn the shipped policies anew."""

import sys
from pathlib import Path

from . import rebuild

if len(sys.argv) != 2:
    sys.exit("usage: python -m controllers.policies FOLDER")
for path in rebuild(Path(sys.argv[1])):
    print(path)
