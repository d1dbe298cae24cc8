"""Makes the 3-D pictures of what is left of the bundled scenarios, each with the robot where it
failed.

    python -m docs.pictures RUN...

A RUN is the file of an ended run of `ditch`, `rubble` or `friction`; its picture goes to
docs/NAME.png. Needs chromium and the extra `test`.
"""

from __future__ import annotations

import asyncio
import io
import math
import sys
from pathlib import Path

from PIL import Image
from tests.scene.test_browser import Page, chromium

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.scene.camera import View, set_up
from ddenv.scene.player import Player
from ddenv.scene.server import Server
from ddenv.scene.stage import Stage

DOCS = Path(__file__).resolve().parent
SIZE = (1200, 700)
COLORS = 256
# What the camera looks at (m), how far away it is (m), from which direction (degrees from the x
# axis) and how high (degrees).
CAMERAS = {
    "ditch": ((0.1, 0.0, 1.9), 7.0, -58.0, 25.0),
    "rubble": ((-0.3, 0.0, 0.4), 3.9, -28.0, 14.0),
    "friction": ((2.0, -0.4, 0.2), 6.5, -60.0, 34.0),
}
LEGEND = ("path of this test", "ghost: the other run", "left out of this test")
READY = (
    "typeof play !== 'undefined' && play && viewer.num_messages_received > 30 && "
    "viewer.renderer.info.render.calls > 8"
)
# Hides Meshcat's own controls, and the entries of the legend that are not in the picture.
TIDY = """
    run(false);
    go(length());
    document.getElementById('play').hidden = true;
    document.querySelectorAll('.dg').forEach((box) => box.style.display = 'none');
    document.querySelectorAll('#legend span').forEach((one) => {
      if (%s.includes(one.textContent)) one.style.display = 'none';
    });
    document.querySelector('#caption .title').textContent = 'the failure in what is left';
"""


def main() -> None:
    for name in sys.argv[1:]:
        with RunFile(Path(name)) as run:
            asyncio.run(picture(run))


async def picture(run: RunFile) -> None:
    """Writes the picture of one run."""
    name = fold(run.events()).scenario["name"]
    server = Server()
    stage = Stage(server.send)
    server.welcome = stage.messages
    player = Player(run, stage, server.say)
    server.player = player
    player.tick(0.0)
    set_up(stage, view(*CAMERAS[name]))
    url = server.listen(0)
    with chromium(SIZE) as port:
        shot = await photograph(await Page.open(port), url)
    await server.close()
    file = DOCS / f"{name}.png"
    Image.open(io.BytesIO(shot)).convert("RGB").quantize(COLORS, dither=Image.Dither.NONE).save(
        file, optimize=True
    )
    print(f"wrote {file}, {file.stat().st_size / 1000:.0f} kB")


def view(
    center: tuple[float, float, float], distance: float, azimuth: float, elevation: float
) -> View:
    def around(far: float, azimuth: float, elevation: float) -> tuple[float, float, float]:
        turn, rise = math.radians(azimuth), math.radians(elevation)
        return (
            far * math.cos(rise) * math.cos(turn),
            far * math.cos(rise) * math.sin(turn),
            far * math.sin(rise),
        )

    return View(
        center,
        around(distance, azimuth, elevation),
        around(2 * distance, azimuth - 60, 50),
        distance,
    )


async def photograph(page: Page, url: str) -> bytes:
    width, height = SIZE
    await page.do(
        "Emulation.setDeviceMetricsOverride",
        width=width,
        height=height,
        deviceScaleFactor=1,
        mobile=False,
    )
    await page.do("Page.navigate", url=url)
    while not await page.value(READY):
        await asyncio.sleep(0.2)
    # The caption comes after the models.
    await asyncio.sleep(2)
    await page.value(TIDY % list(LEGEND))
    await asyncio.sleep(0.5)
    return await page.screenshot()


if __name__ == "__main__":
    main()
