"""What the user may decide: each command with its rule and its words, written once.

A command says why it is not possible now (`refusal`) and what it is in words (`words`). The engine obeys commands by these rules,
keys, footer, command palette and help offer them by the same ones. What was decided is an event: the fold has the words for those.
"""
