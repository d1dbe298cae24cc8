"""The user's commands: for each, when it is allowed and its words, written once.

A command says why it is not possible now (`refusal`) and describes itself (`words`). The engine obeys commands by these rules; the
keys, the footer, the command palette and the help offer them by the same rules. A decision becomes an event, and the fold has the
words for it.
"""
