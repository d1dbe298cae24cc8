"""`python -m ddenv` is `ddenv`."""

from ddenv.cli import main

main()
