"""Packs the package into a wheel for pip, on the standard library alone (PEP 517, PEP 427).

The package is plain Python; with a builder of its own `pip install` needs neither network nor setuptools nor wheel, which
machines in a lab often lack.
"""

import base64
import hashlib
import io
import pathlib
import re
import tarfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent
PACKAGE = "fiducap"


def _field(name):
    return re.search(rf'^{name} = "(.*)"$', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE).group(1)


def _stem():
    return f"{PACKAGE}-{_field('version')}"


def _metadata():
    return (
        f"Metadata-Version: 2.1\nName: {_field('name')}\nVersion: {_field('version')}\n"
        f"Summary: {_field('description')}\nLicense: {_field('license')}\nRequires-Python: {_field('requires-python')}\n"
    )


def _files():
    """Name in the wheel → bytes."""
    files = {path.relative_to(ROOT).as_posix(): path.read_bytes() for path in sorted((ROOT / PACKAGE).glob("*.py"))}
    info = f"{_stem()}.dist-info"
    files[f"{info}/METADATA"] = _metadata().encode()
    files[f"{info}/WHEEL"] = b"Wheel-Version: 1.0\nGenerator: fiducap\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    return files


def _record_line(name, content):
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(content)}\n"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    name = f"{_stem()}-py3-none-any.whl"
    record = f"{_stem()}.dist-info/RECORD"
    files = _files()
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in files.items():
            wheel.writestr(path, content)
        wheel.writestr(record, "".join(_record_line(*entry) for entry in files.items()) + f"{record},,\n")
    return name


def build_sdist(sdist_directory, config_settings=None):
    name = f"{_stem()}.tar.gz"
    about = tarfile.TarInfo(f"{_stem()}/PKG-INFO")
    about.size = len(_metadata().encode())
    with tarfile.open(pathlib.Path(sdist_directory) / name, "w:gz", format=tarfile.PAX_FORMAT) as archive:
        modules = (path.relative_to(ROOT).as_posix() for path in (ROOT / PACKAGE).glob("*.py"))
        for path in ["pyproject.toml", "wheel_builder.py", *modules]:
            archive.add(ROOT / path, f"{_stem()}/{path}")
        archive.addfile(about, io.BytesIO(_metadata().encode()))
    return name
