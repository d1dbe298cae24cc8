"""What several screens share: the run as it is read, its programs, words, and messages to the
app.
"""
