"""Packs the package and its library into a wheel for pip, on the standard library alone (PEP 517, PEP 427).

With a builder of its own `pip install` needs neither network nor setuptools nor wheel, which machines in a lab often lack.

The library is the one at $FIDUCAP_LIBRARY, else the one beside the package (a source archive has it), else what `./dev build`
or a build of the client alone left in build/. FIDUCAP_LIBRARY=system packs none: the system's is used.
"""

import base64
import hashlib
import io
import os
import pathlib
import re
import sysconfig
import tarfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent
PACKAGE = "fiducap"
LIBRARY = "libfiducap.so.1"
BUILDS = ("release/client", "client", "python-client", "debug/client")  # below build/, the first that has one


def _field(name):
    return re.search(rf'^{name} = "(.*)"$', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE).group(1)


def _stem():
    return f"{PACKAGE}-{_field('version')}"


def _metadata():
    return (
        f"Metadata-Version: 2.1\nName: {_field('name')}\nVersion: {_field('version')}\n"
        f"Summary: {_field('description')}\nLicense: {_field('license')}\nRequires-Python: {_field('requires-python')}\n"
    )


def _library():
    """The library's file; None when the system's is to be used."""
    named = os.environ.get("FIDUCAP_LIBRARY")
    if named == "system":
        return None
    built = [ROOT.parent.parent / "build" / folder / LIBRARY for folder in BUILDS]
    places = [pathlib.Path(named)] if named else [ROOT / PACKAGE / LIBRARY, *built]
    for place in places:
        if place.is_file():
            return place
    raise SystemExit(
        f"fiducap: {LIBRARY} is not built yet (looked for {', '.join(map(str, places))}). Run `./dev build` in the project's folder, "
        "or `cmake -S client -B build/client && cmake --build build/client`, then pip again. FIDUCAP_LIBRARY=/path/to/"
        f"{LIBRARY} names another one, FIDUCAP_LIBRARY=system packs none."
    )


def _tag(library):
    """Any Python 3; with a library on machines like this one only."""
    if library is None:
        return "py3-none-any"
    return "py3-none-" + re.sub(r"[-.]", "_", sysconfig.get_platform())


def _files(library):
    """Name in the wheel → bytes."""
    files = {path.relative_to(ROOT).as_posix(): path.read_bytes() for path in sorted((ROOT / PACKAGE).glob("*.py"))}
    if library is not None:
        files[f"{PACKAGE}/{LIBRARY}"] = library.read_bytes()
    info = f"{_stem()}.dist-info"
    pure = "true" if library is None else "false"
    files[f"{info}/METADATA"] = _metadata().encode()
    files[f"{info}/WHEEL"] = (
        f"Wheel-Version: 1.0\nGenerator: fiducap\nRoot-Is-Purelib: {pure}\nTag: {_tag(library)}\n".encode()
    )
    return files


def _record_line(name, content):
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(content)}\n"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    library = _library()
    name = f"{_stem()}-{_tag(library)}.whl"
    record = f"{_stem()}.dist-info/RECORD"
    files = _files(library)
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in files.items():
            wheel.writestr(path, content)
        wheel.writestr(record, "".join(_record_line(*entry) for entry in files.items()) + f"{record},,\n")
    return name


def build_sdist(sdist_directory, config_settings=None):
    name = f"{_stem()}.tar.gz"
    library = _library()
    about = tarfile.TarInfo(f"{_stem()}/PKG-INFO")
    about.size = len(_metadata().encode())
    with tarfile.open(pathlib.Path(sdist_directory) / name, "w:gz", format=tarfile.PAX_FORMAT) as archive:
        modules = (path.relative_to(ROOT).as_posix() for path in (ROOT / PACKAGE).glob("*.py"))
        for path in ["pyproject.toml", "wheel_builder.py", *modules]:
            archive.add(ROOT / path, f"{_stem()}/{path}")
        if library is not None:
            archive.add(library.resolve(), f"{_stem()}/{PACKAGE}/{LIBRARY}")
        archive.addfile(about, io.BytesIO(_metadata().encode()))
    return name
