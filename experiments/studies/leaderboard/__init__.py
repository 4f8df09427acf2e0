"""Who swings up best? Trainings and trials of many controllers, each kept in a file of its own; `__main__` runs it."""
