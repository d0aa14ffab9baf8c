"""The digest of the IDL texts changes with the contract and with nothing else."""
import importlib.util
import pathlib
import sys

root = pathlib.Path(sys.argv[1])
spec = importlib.util.spec_from_file_location("interface_hash", root / "idl/cpp/interface_hash.py")
interface_hash = importlib.util.module_from_spec(spec)
spec.loader.exec_module(interface_hash)
digest = interface_hash.digest

texts = [file.read_text() for file in sorted((root / "idl").glob("*.idl"))]
base = digest(texts)
failures = []


def expect(condition, what):
    if not condition:
        failures.append(what)


def changed(old, new):
    spoilt = [text.replace(old, new, 1) for text in texts]
    assert spoilt != texts, f"the contract no longer holds '{old}'"
    return digest(spoilt)


expect(len(texts) == 13, "thirteen files")
expect(digest(reversed(texts)) == base, "the order of the files does not count")
expect(digest([text.replace("\n", "\r\n") for text in texts]) == base, "line ends do not count")
expect(changed("// [rad]", "// [deg]") == base, "comments do not count")
expect(changed("double beta_rad;", "double beta_rad ;") == base, "white space does not count")
expect(changed("double beta_rad;", "float beta_rad;") != base, "a type counts")
expect(changed("double beta_rad;", "double beta_deg;") != base, "a name counts")
expect(changed("sequence<Spot, 64>", "sequence<Spot, 65>") != base, "a bound counts")
expect(changed("TILT_INVALID, TILT_DEGRADED", "TILT_DEGRADED, TILT_INVALID") != base, "order counts")
expect(digest(texts[:-1]) != base, "a missing file counts")
print("\n".join(f"not so: {failure}" for failure in failures))
sys.exit(1 if failures else 0)
