"""Several builds of one program print the same, to the last character. Each argument is a command."""

import pathlib
import shlex
import subprocess
import sys

SKIPPED = 77


def output_of(command):
    words = shlex.split(command)
    if not pathlib.Path(words[-1]).exists():
        print(f"{words[-1]} is not built: tools/arm/build box_programs")
        sys.exit(SKIPPED)
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()


def main():
    commands = sys.argv[1:]
    outputs = [output_of(command) for command in commands]
    first = outputs[0]
    print(f"{len(first)} lines of {commands[0]}")
    if len(first) < 100:
        print("too few to compare anything")
        return 1
    for command, other in zip(commands[1:], outputs[1:]):
        for number, (here, there) in enumerate(zip(first, other), start=1):
            if here != there:
                print(f"line {number}\n{here}\n{there}   {command}")
                return 1
        if len(other) != len(first):
            print(f"{len(other)} lines of {command}")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
