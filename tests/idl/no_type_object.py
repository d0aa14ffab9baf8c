"""Fails when type objects are generated, registered or asked for anywhere.

Type objects on one side only have crashed the process on the other, and other vendors reject discovery
data that carries them.

  no_type_object.py GENERATED_DIR SOURCE_DIR...
  no_type_object.py --self-test
"""
import pathlib
import re
import sys
import tempfile

SUSPECT = re.compile(r"-typeobject|TypeObjectFactory|register_type_object_representation|register\w+Types\(|"
                     r"auto_fill_type_(?:object|information)\(\s*true")
BUILD_FILES = {".cc", ".h", ".cxx", ".cmake", ".txt", ".c"}


def findings(generated, sources):
    if not any(generated.glob("*.cxx")):
        yield f"{generated}: no generated code found; the test looks in the wrong place"
    for file in generated.rglob("*"):
        if "TypeObject" in file.name:
            yield f"{file}: a type object was generated"
    for root in [generated, *sources]:
        for file in root.rglob("*"):
            if file.suffix not in BUILD_FILES or not file.is_file():
                continue
            for number, line in enumerate(file.read_text(errors="replace").splitlines(), 1):
                code = re.split(r"(?://|#(?!include|define))", line)[0]
                if SUSPECT.search(code):
                    yield f"{file}:{number}: {line.strip()}"


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        generated = root / "generated"
        sources = root / "sources"
        generated.mkdir()
        sources.mkdir()
        (generated / "event.cxx").write_text("// plain\n")
        (sources / "CMakeLists.txt").write_text("COMMAND gen -cs x.idl  # never -typeobject\n")
        missed = [] if not list(findings(generated, [sources])) else ["clean tree refused"]
        for place, text in ((generated / "eventTypeObject.cxx", ""),
                            (sources / "a.cc", "TypeObjectFactory::get_instance();\n"),
                            (sources / "CMakeLists.txt", "COMMAND gen -cs -typeobject x.idl\n")):
            before = place.read_text() if place.exists() else None
            place.write_text(text)
            if not list(findings(generated, [sources])):
                missed.append(f"not found: {place.name}")
            place.unlink() if before is None else place.write_text(before)
        return missed


if __name__ == "__main__":
    if "--self-test" in sys.argv:
        problems = self_test()
    else:
        problems = list(findings(pathlib.Path(sys.argv[1]), [pathlib.Path(p) for p in sys.argv[2:]]))
    print("\n".join(problems))
    sys.exit(1 if problems else 0)
