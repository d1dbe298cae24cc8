"""What a simulator that costs nothing says of a world."""

from zlib import crc32


def needs(*names):
    return lambda keep, seed: "similar" if set(names) <= keep else "pass"


def flaky(salt, *names):
    """Shows f in most runs that have the needed models, sometimes something else, always the same
    for the same run.
    """

    def oracle(keep, seed):
        luck = crc32(f"{salt} {sorted(keep)} {seed}".encode()) % 10
        if not set(names) <= keep:
            return "other" if luck < 3 else "pass"
        return "similar" if luck < 8 else "pass"

    return oracle
