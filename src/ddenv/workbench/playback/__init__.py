"""A finished test played back on the map, alone or over another one."""
