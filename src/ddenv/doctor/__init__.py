"""What is well and what is not: this installation, this machine, and one run file."""
