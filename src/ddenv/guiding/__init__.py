"""The user's commands: for each, when it is allowed (`refusal`) and its words. The engine and the
keys obey the same rules.
"""
