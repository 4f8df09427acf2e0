"""The main job on bundled logs, from a log to a diagnosis and to controllers; `furuta demo` runs it."""
