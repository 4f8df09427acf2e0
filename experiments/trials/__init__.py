"""Blind trials of the diagnosis: rigs of the bench that hide things, answers from their logs alone, and the marks.

`plan` says which rigs, `seal` builds them and writes their logs, `decide` sees the logs and nothing else, `run` brings
the two together, `scoring` compares truth and answers, `report` shows the result.
"""
