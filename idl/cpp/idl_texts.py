"""Writes the IDL texts as a table that codec.cc includes.

  idl_texts.py OUT.inc A.idl B.idl ...

One line {name of a struct that a topic carries, text of its file} for each struct of each file.
"""
import pathlib
import re
import sys


def literal(text):
    """Raw string literals; compilers promise no more than 64 kB for each."""
    return 'R"IDL(' + text + ')IDL"'


if __name__ == "__main__":
    out = pathlib.Path(sys.argv[1])
    rows = []
    for name in sys.argv[2:]:
        text = pathlib.Path(name).read_text(encoding="utf-8")
        for struct in re.findall(r"^struct (\w+)", text, re.MULTILINE):
            rows.append(f'{{"tbm::v1::{struct}", {literal(text)}}},\n')
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("".join(rows), encoding="utf-8")
