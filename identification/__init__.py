"""From measured logs to a plant: logs → signals → regression or predictor → estimate, and diagnosis.

Each step lives in the module named after its result; import from there, for example
``from identification.logs import read_log``. This package file imports nothing, so that a light task
(reading a log) does not pay for a heavy one (compiling an estimator).
"""
