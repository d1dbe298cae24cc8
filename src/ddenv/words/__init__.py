"""What happens in a run, in words: the same lines on the terminal, on the screens and in
reports.
"""
