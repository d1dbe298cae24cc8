"""Listens to a controller: what it is given, and what it commands. The run keeps its bits."""

from __future__ import annotations

from typing import Protocol

from ddenv.robot.protocol import Drives, Reading, Setup, Twist, WheelSpeeds


class Listener(Protocol):
    """Something that hears a run."""

    def begin(self, setup: Setup) -> None:
        """A run begins; what was heard before it is void, since a run may be made again from its start."""

    def hear(self, reading: Reading, command: Twist | WheelSpeeds) -> None:
        """What the controller was given, and its command."""


class Heard:
    """A controller with a listener."""

    def __init__(self, controller: Drives, setup: Setup, listener: Listener) -> None:
        self._controller, self._listener = controller, listener
        listener.begin(setup)

    @property
    def arrived(self) -> bool:
        return bool(getattr(self._controller, "arrived", False))

    def step(self, reading: Reading) -> Twist | WheelSpeeds:
        command = self._controller.step(reading)
        self._listener.hear(reading, command)
        return command
