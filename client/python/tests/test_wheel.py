"""What `pip install` gets."""

import base64
import csv
import hashlib
import io
import os
import pathlib
import sys
import tempfile
import unittest
import unittest.mock
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
import wheel_builder  # noqa: E402


class WheelTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.library = self.folder / "libfiducap.so.1"
        self.library.write_bytes(b"not really one")
        self.use(self.library)

    def use(self, library):
        """What $FIDUCAP_LIBRARY says."""
        patch = unittest.mock.patch.dict(os.environ, FIDUCAP_LIBRARY=str(library))
        patch.start()
        self.addCleanup(patch.stop)

    def test_holds_the_library_for_machines_like_this_one(self):
        name = wheel_builder.build_wheel(str(self.folder))
        self.assertRegex(name, r"^fiducap-[0-9.]+-py3-none-linux_\w+\.whl$")
        with zipfile.ZipFile(self.folder / name) as wheel:
            self.assertEqual(wheel.read("fiducap/libfiducap.so.1"), self.library.read_bytes())

    def test_without_a_library_it_says_how_to_build_one(self):
        self.use(self.folder / "nowhere.so")
        with self.assertRaises(SystemExit) as end:
            wheel_builder.build_wheel(str(self.folder))
        self.assertIn("./dev build", str(end.exception))

    def test_holds_every_module_and_lists_each_file_with_its_hash(self):
        self.use("system")
        name = wheel_builder.build_wheel(str(self.folder))
        self.assertRegex(name, r"^fiducap-[0-9.]+-py3-none-any\.whl$")
        with zipfile.ZipFile(self.folder / name) as wheel:
            names = wheel.namelist()
            for module in (ROOT / "fiducap").glob("*.py"):
                self.assertIn(f"fiducap/{module.name}", names)
            record = next(entry for entry in names if entry.endswith(".dist-info/RECORD"))
            rows = list(csv.reader(io.StringIO(wheel.read(record).decode())))
            self.assertEqual(sorted(row[0] for row in rows), sorted(names))
            for path, digest, size in rows:
                if path == record:
                    continue
                content = wheel.read(path)
                wanted = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
                self.assertEqual((digest, size), (f"sha256={wanted}", str(len(content))))

    def test_a_source_archive_can_be_built_from(self):
        import tarfile

        name = wheel_builder.build_sdist(str(self.folder))
        with tarfile.open(self.folder / name) as archive:
            names = [pathlib.PurePosixPath(entry).name for entry in archive.getnames()]
        for needed in ("pyproject.toml", "wheel_builder.py", "PKG-INFO", "client.py", "libfiducap.so.1"):
            self.assertIn(needed, names)


if __name__ == "__main__":
    unittest.main()
