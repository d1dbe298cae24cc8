"""How much time and memory it takes to read worlds, compared with only parsing their XML with the standard library.

python benchmarks/reading.py
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree

from ddenv.world.load import SDF

MODELS = 5000
REPEATS = 5


def model(number: int) -> str:
    """A box in a row of a hundred, as Gazebo writes it."""
    x, y = number % 100, number // 100
    shape = "<geometry><box><size>0.5 0.5 0.5</size></box></geometry>"
    surface = "<surface><friction><ode><mu>0.8</mu><mu2>0.8</mu2></ode></friction><bounce/><contact><ode/></contact></surface>"
    inertia = "<inertia><ixx>0.04</ixx><iyy>0.04</iyy><izz>0.04</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>"
    return (
        f"<model name='crate {number}'><pose frame=''>{x} {y} 0.25 0 0 0</pose><static>{number % 2}</static><link name='link'>"
        f"<inertial><mass>1</mass>{inertia}</inertial><collision name='collision'>{shape}{surface}</collision>"
        f"<visual name='visual'>{shape}<material><diffuse>0.7 0.5 0.3 1</diffuse></material></visual></link></model>"
    )


def saved(number: int) -> str:
    pose = f"<pose frame=''>{number % 100} {number // 100} 0.25 0 0 0.1</pose>"
    return f"<model name='crate {number}'>{pose}<scale>1 1 1</scale><link name='link'>{pose}</link></model>"


def crates(count: int) -> str:
    """A world of `count` models with their `<state>`."""
    models, state = (map(each, range(count)) for each in (model, saved))
    return f"<sdf version='1.6'><world name='crates'>{''.join(models)}<state>{''.join(state)}</state></world></sdf>"


def measure(path: Path) -> tuple[int, int, float, float, float]:
    """Models, collisions, s to read, s to parse only the XML, and the process's maximum memory in MB before that."""
    from ddenv.world.sdf.read import read_world

    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        world = read_world(path)
        times.append(time.perf_counter() - start)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
    alone = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        ElementTree.parse(path)
        alone.append(time.perf_counter() - start)
    collisions = sum(len(model.collisions) for model in world.models)
    return len(world.models), collisions, sorted(times)[REPEATS // 2], sorted(alone)[REPEATS // 2], memory


def main() -> None:
    if len(sys.argv) > 1:
        print(*measure(Path(sys.argv[1])))
        return
    print("| world | models | shapes | read, s | XML alone, s | ratio | memory, MB |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        generated = Path(folder) / "crates.sdf"
        generated.write_text(crates(MODELS))
        for path in (SDF / "worlds" / "ditch.sdf", generated):
            # A process of its own, so that its memory is that of this world only.
            done = subprocess.run([sys.executable, __file__, path], capture_output=True, text=True, check=True)
            models, shapes, read, alone, memory = done.stdout.split()
            times = f"{float(read):.2f} | {float(alone):.2f} | {float(read) / float(alone):.1f}"
            print(f"| {path.stem} | {models} | {shapes} | {times} | {float(memory):.0f} |")


if __name__ == "__main__":
    main()
