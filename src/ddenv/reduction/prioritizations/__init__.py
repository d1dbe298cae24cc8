"""In which order partitions are tried (paper, Table I): one schema a file.

A schema takes the partitions and the evidence, and gives each a score; the lowest is tried first, ties stay in the order of the
split. The scores of a schema whose name ends in `-proximal` are distances in m.
"""
