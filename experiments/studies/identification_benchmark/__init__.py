"""How close identification comes to the Cramér–Rao bound: `python -m experiments.studies.identification_benchmark`.

Rigs × sample times × encoder counts × experiments × seeds, all simulated by the model that is fitted, with torque
noise, so that the bound is known. `cases` makes the logs and their bounds, `methods` are the estimators side by side,
`mujoco_windows` is a peer built of MuJoCo's parts, `study` runs everything, `summary` makes tables and the plot.
"""
