"""How many tests a reduction will take, and how long that is: it is played many times, each with other needed models."""
