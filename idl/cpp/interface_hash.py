"""Writes a C++ header with a digest of the IDL texts.

  interface_hash.py OUT.h A.idl B.idl ...

Two programs talk in earnest only when their digests agree. Comments and white space do not count; the
order of the files does not either.
"""
import hashlib
import pathlib
import re
import sys

VERSION = "v1"


def bare(text):
    """The IDL without comments, one blank between words."""
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL)
    text = re.sub(r"//[^\n]*", " ", text)
    return " ".join(re.findall(r"\w+|[^\s\w]", text))


def digest(texts):
    """First 16 hexadecimal digits of SHA-256 over the bare texts, in alphabetical order."""
    return hashlib.sha256("\n".join(sorted(bare(text) for text in texts)).encode()).hexdigest()[:16]


if __name__ == "__main__":
    out = pathlib.Path(sys.argv[1])
    value = digest(pathlib.Path(name).read_text(encoding="utf-8") for name in sys.argv[2:])
    header = f'#pragma once\n\n#define TBM_INTERFACE_USER_DATA "tbm-interface={VERSION}:{value}"\n'
    out.parent.mkdir(parents=True, exist_ok=True)
    if not out.exists() or out.read_text() != header:
        out.write_text(header)
