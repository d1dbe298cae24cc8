"""The reduction itself: partitionings, prioritizations, algorithms, verdicts and rates. It is pure:
it runs nothing.
"""
