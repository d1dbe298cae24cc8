"""Teaching: lessons over recorded runs, predictions, scores. It needs neither Drake nor an engine,
and runs no code of a lesson.
"""
