#!/usr/bin/env bash
# tools/setup must refuse other systems in words, and have nothing to do on a machine that is set up.
set -u
root=$1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

printf 'ID=ubuntu\nVERSION_ID=24.04\nPRETTY_NAME="Ubuntu 24.04"\n' >"$scratch/os"
message=$(TBM_OS_RELEASE=$scratch/os "$root/tools/setup" 2>&1) && { echo "accepted Ubuntu"; exit 1; }
case $message in *"Ubuntu 24.04"*"Debian 12"*) ;; *) echo "unclear: $message"; exit 1 ;; esac

message=$(TBM_OS_RELEASE=$scratch/none "$root/tools/setup" 2>&1) && { echo "accepted nothing"; exit 1; }
case $message in *"not Debian 12"*) ;; *) echo "unclear: $message"; exit 1 ;; esac

# A package list with a name nobody has: --check names it.
mkdir -p "$scratch/tools"
cp "$root/tools/setup" "$scratch/tools/"
echo "tbm-no-such-package  for this test" >"$scratch/tools/packages.txt"
message=$("$scratch/tools/setup" --check 2>&1) && { echo "found what is not there"; exit 1; }
case $message in *tbm-no-such-package*) ;; *) echo "unclear: $message"; exit 1 ;; esac

"$root/tools/setup" --check || { echo "this machine is not set up"; exit 1; }
