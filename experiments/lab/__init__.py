"""The lab session: rigs that a teacher seals with a key of his own, and the marking of what students found.

`rigs` draws rigs and writes what a group gets, `vault` locks what they hide, `marking` compares it with a diagnosis.
Rigs, logs and marks are those of the blind trials (`experiments.trials`).
"""
