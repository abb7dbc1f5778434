"""Assembles a wheel from a library that Cargo has built: assemble.py LIBRARY FOLDER.

maturin writes the metadata. A build by maturin itself would compile the dependencies once more, with
the features that this package needs alone; ``release.yml`` builds the wheels that way.
"""

import base64
import hashlib
import subprocess
import sys
import zipfile
from pathlib import Path

PACKAGE = Path(__file__).parent.parent


def metadata(folder: Path) -> Path:
    """Lets maturin write the folder ``*.dist-info``."""
    arguments = ["pep517", "write-dist-info", "--metadata-directory", str(folder)]
    command = [sys.executable, "-m", "maturin", *arguments, "--interpreter", sys.executable]
    subprocess.run(command, cwd=PACKAGE, check=True, capture_output=True)
    return next(folder.glob("*.dist-info"))


def tag(info: Path) -> str:
    """The tag in the metadata, such as ``cp310-abi3-linux_x86_64``."""
    lines = (info / "WHEEL").read_text().splitlines()
    return next(line.removeprefix("Tag: ") for line in lines if line.startswith("Tag: "))


def content(library: Path, info: Path) -> dict[str, bytes]:
    """The files of the wheel by name."""
    files = {f"navfuse/{f.name}": f.read_bytes() for f in (PACKAGE / "navfuse").iterdir() if f.is_file()}
    files["navfuse/_navfuse.abi3.so"] = library.read_bytes()
    kept = (f for f in info.rglob("*") if f.is_file() and f.name != "RECORD")
    return files | {str(f.relative_to(info.parent)): f.read_bytes() for f in kept}


def record(name: str, data: bytes) -> str:
    """The line of a file in ``RECORD``."""
    digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
    return f"{name},sha256={digest},{len(data)}\n"


def main(library: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    info = metadata(folder)
    wheel = folder / f"{info.stem}-{tag(info)}.whl"
    files = content(library, info)
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
        lines = "".join(record(name, data) for name, data in files.items())
        archive.writestr(f"{info.name}/RECORD", f"{lines}{info.name}/RECORD,,\n")
    print(wheel)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
