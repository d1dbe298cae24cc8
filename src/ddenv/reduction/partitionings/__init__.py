"""How the environment is split (paper, Table I): one schema a file.

A schema takes the environment, n and the evidence, and gives at most n disjoint, non-empty partitions that cover it.
"""
