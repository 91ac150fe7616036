"""Procedural objects per second: ``python -m benchmarks.objects --count 50``."""

import argparse
import time

import numpy as np

from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import CATEGORIES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50, help="objects per category")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(f"{'category':10} {'objects/s':>10} {'median ms':>10} {'median CPU ms':>14} {'median faces':>13}")
    for category in CATEGORIES:
        procedural_shape(category, arguments.seed + 1, 0)
        wall, cpu, faces = [], [], []
        for index in range(arguments.count):
            wall_start, cpu_start = time.perf_counter(), time.process_time()
            shape = procedural_shape(category, arguments.seed, index)
            wall.append(time.perf_counter() - wall_start)
            cpu.append(time.process_time() - cpu_start)
            faces.append(len(shape.mesh.faces))
        print(
            f"{category:10} {len(wall) / sum(wall):10.0f} {1e3 * np.median(wall):10.1f} "
            f"{1e3 * np.median(cpu):14.1f} {np.median(faces):13.0f}"
        )


if __name__ == "__main__":
    main()
