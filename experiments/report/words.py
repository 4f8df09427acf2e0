"""What the report says in sentences."""

from __future__ import annotations

MEANING = {
    "named": (
        "What is named here explains what model (5) misses on these logs, clearly better than anything else in the "
        "library. The plant file contains it."
    ),
    "ambiguous": (
        "An effect is missing, and these logs cannot tell which of several it is. The plant file contains the first; "
        "the others would predict these logs as well, but not other motions."
    ),
    "none": (
        "Model (5) describes these logs as well as the noise allows. Nothing was added. An effect that these motions "
        "do not excite can still be there."
    ),
    "unknown": (
        "Something is missing that the library does not hold, or holds only in part. Trust the plant file no further "
        "than the motions of these logs."
    ),
    "insufficient_excitation": (
        "The logs do not move the rig enough to determine the parameters of model (5). Without them, nothing can be "
        "said about missing effects, and there is no plant file."
    ),
}
"""By verdict: what it means for the reader."""

NEXT = {
    "named": (
        "Use plant.json in the simulator. To be sure, record a log of another kind of motion and run "
        "`furuta validate plant.json` on it: the error should stay near the noise floor."
    ),
    "ambiguous": (
        "Record a log that tells the look-alikes apart, and diagnose all logs together: "
        "`furuta excite --plant plant.json --between {pair} -o u.csv` designs the command. A slow, wide sweep of the "
        "arm does it for most pairs, because the arm then spends time near zero speed at many angles."
    ),
    "none": (
        "Nothing needs doing. If the simulator fails in a motion that these logs do not contain, record that motion "
        "and diagnose it too."
    ),
    "unknown": (
        "Look at the missing torques and their means in section 3: they say on which row, when and against what the "
        "model fails. Repeat the experiment to see whether it returns; if it does, describe it as a new effect."
    ),
    "insufficient_excitation": (
        "Record a longer log with more motion: larger and faster changes of the command for the arm, and the pendulum "
        "away from its rest. A log of the hanging pendulum can be fitted together with one of the upright."
    ),
}
"""By verdict: what to do, where the search itself has no advice."""

LABEL = {
    "named": "named",
    "ambiguous": "ambiguous",
    "none": "nothing missing",
    "unknown": "unknown effect",
    "insufficient_excitation": "not enough excitation",
}
"""By verdict: a few words for its badge."""
