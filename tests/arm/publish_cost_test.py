"""Instructions of making and publishing a frame's two messages on the emulated Cortex-A8, with a reader of both on the
PC. Together with what frame_cost_test.py allows for the frame itself: 3 M.

Fast DDS has threads of its own; what they do while a message is handed over is in the count, so it repeats less well.
"""

import argparse
import pathlib
import shlex
import subprocess
import sys

import frame_cost_test as frame_cost

REGION = 20
WHOLE_BUDGET = 3_000_000
FRAME_BUDGET = frame_cost.STEPS[7][1]
DOMAIN = "163"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--emulator", required=True)
    parser.add_argument("--plugin", required=True, type=pathlib.Path)
    parser.add_argument("--program", required=True, type=pathlib.Path, help="publish_cost of the box's build")
    parser.add_argument("--shim", required=True, help="libmulticast_shim.so of the same build")
    parser.add_argument("--tbm", required=True, help="the PC's tbm")
    arguments = parser.parse_args()
    if not arguments.program.exists():
        print(f"{arguments.program} is not built: tools/arm/build box_programs")
        return frame_cost.SKIPPED

    reader = subprocess.Popen(
        [arguments.tbm, "watch", "--domain", DOMAIN], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        emulator = f"{arguments.emulator} -E LD_PRELOAD={shlex.quote(arguments.shim)}"
        counts, said = frame_cost.count(emulator, arguments.plugin, arguments.program, DOMAIN)
    finally:
        reader.terminate()
        reader.wait()
    print(f"{'':38} instructions      neon     vfp64  load/store    budget   ESTIMATE in ms at 1 GHz")
    budget = WHOLE_BUDGET - FRAME_BUDGET
    frame_cost.print_row("two messages, conversion, DDS", counts[REGION], 0, budget)
    print("\n".join(said.values()))
    if counts[REGION]["instructions"] > budget:
        print(f"FAILED more than {budget:,} instructions, what a frame's {FRAME_BUDGET:,} leave of {WHOLE_BUDGET:,}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
