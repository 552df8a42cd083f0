#!/usr/bin/env python3
"""Every command of the guide is run: guide_test.py SOURCE PROGRAMS [--only DOCUMENT].

Documents are read from top to bottom, in an empty folder of their own, as a person would type them.
A line that says `# needs …` is for hardware, files or time that are not here: a server with a
camera runs with a simulated robot in its place (`needs a camera`), of any other such line the words
are looked up in --help. Where a person does something (holds a sheet, puts the IMU down, measures
tags), stand_ins.py does it. Ports are free ones; nothing depends on how quick this machine is.
"""
import argparse
import pathlib
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile

import stand_ins
from commands import PROGRAMS, Command, Words, blocks, commands

RUN = ("docs/guide.md", "docs/calibration.md", "docs/import.md")
LOOKED_UP = ("README.md", "docs/setups.md", "docs/natnet-clients.md", "docs/clients.md",
             "docs/maps.md", "docs/operation.md", "docs/recording.md",
             "docs/experiments.md")
NO_COMMANDS = ("cpp", "python", "yaml", "text", "mermaid")
# Blocks without a language that are not commands, by their first line.
PLAIN = ("image,tag,corner,u,v", "IMU,<microseconds>", "for n in ")
TOOLS = ("bash", "openssl")
# Options with which fiducapd ends by itself.
ENDS = ("--check-config", "--print-config", "--version", "--help", "--exit-at-end")


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Walk:
    """One document, typed from top to bottom."""

    def __init__(self, source, programs, folder):
        self.source, self.programs, self.folder = source, programs, folder
        self.words = Words(programs)
        self.dev = (source / "dev").read_text(encoding="utf-8")
        self.web, self.native, self.vrpn = free_port(), free_port(), free_port()
        self.page = stand_ins.Page(self.web)
        self.server, self.log = None, folder / "server.log"
        self.ran, self.looked_up, self.faults = 0, 0, []
        (folder / "build/release").mkdir(parents=True)
        (folder / "build/release/bin").symlink_to(programs)
        for name in ("config", "docs"):
            (folder / name).symlink_to(source / name)
        (folder / "environment").write_text("", encoding="utf-8")

    def knows_programs(self):
        """For a document that assumes installed programs; the guide has their folder."""
        (self.folder / "environment").write_text(f"PATH={shlex.quote(str(self.programs))}:$PATH\n",
                                                 encoding="utf-8")

    # --- one command ------------------------------------------------------------------------------

    def take(self, command):
        try:
            if command.needs and not self.has_stand_in(command):
                return self.look_up(command)
            self.prepare(command)
            self.ran += 1
            if command.program() == "fiducapd" and not set(ENDS) & set(command.words()):
                self.serve(command)
            else:
                self.shell(command)
        except (OSError, ValueError, RuntimeError, subprocess.CalledProcessError) as error:
            self.faults.append(f"{command.where}: {command.text}\n  {error}")

    def has_stand_in(self, command):
        return command.program() == "fiducapd" and command.needs.startswith("needs a camera")

    def look_up(self, command):
        self.looked_up += 1
        words = command.words()
        if words[0].startswith("docs/"):
            words[0] = str(self.source / words[0])
        if fault := self.words.fault(words):
            self.faults.append(f"{command.where}: {command.text}\n  {fault}")

    def look_up_dev(self, where, verb):
        self.looked_up += 1
        if not re.search(rf"^  [^)\n]*\b{verb}\b[^)\n]*\)(?: |$)", self.dev, re.M):
            self.faults.append(f"{where}: ./dev has no {verb}")

    def rewritten(self, command):
        """The command with free ports, and a simulated robot where it needs a camera."""
        text, options = command.text, ""
        for key, value in (("web.port", self.web), ("native.port", self.native),
                           ("vrpn.port", self.vrpn), ("natnet.enabled", "false")):
            options += f" --set streaming.{key}={value}"
        if command.program() == "fiducapd":
            if command.needs and "--setup" in text:
                options += " --simulated"
            elif command.needs:
                options += " --set 'bodies.0.source={type: simulator}'"
                # Always in view of a tag: doctor complains of a robot that sees none.
                options += " --set simulation.preset=table --set simulation.tag_size_m=0.16"
            return re.sub(r"\bfiducapd\b", "fiducapd" + options, text, count=1)
        text = re.sub(r"\bfiducap (watch|events|doctor|control \w+)",
                      rf"fiducap \1 --server 127.0.0.1:{self.native}", text)
        text = re.sub(r"\bfiducap doctor", "fiducap doctor" + options, text)
        return re.sub(r"(tag_distance\.py)", rf"\1 --programs {self.programs}", text)

    def shell(self, command):
        line = self.rewritten(command)
        script = (f"set -a; . ./environment; set +a\n{line}\nresult=$?\n"
                  "export -p > environment; exit $result\n")
        run = subprocess.run(["bash", "-c", script], cwd=self.folder, text=True, check=False,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=240)
        if run.returncode != 0:
            raise RuntimeError(f"exit code {run.returncode} of: {line}\n{run.stdout[-1500:]}")

    def serve(self, command):
        self.stop()
        line = self.rewritten(command)
        with open(self.log, "w", encoding="utf-8") as log:
            self.server = subprocess.Popen(
                ["bash", "-c", f". ./environment; exec {line}"], cwd=self.folder, stdout=log,
                stderr=log)
        stand_ins.wait_for(line, lambda: self.says("serving ") or self.says("set-up of "))
        if "--setup" not in line:
            return
        stand_ins.wait_for("the address of the set-up", self.take_secret)
        if "--simulated" not in command.text:
            stand_ins.wait_for("the set-up", lambda: self.page.setup().get("step") == "camera")
            return self.stop()
        self.compare_steps(self.page.lead_through())
        stand_ins.wait_for("the server", lambda: self.says("serving 1 bodies"))

    def take_secret(self):
        """Of the address that the server prints for a person."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        printed = re.search(rf"http://127\.0\.0\.1:{self.web}/#([0-9a-f]{{32}})\n", text)
        self.page.secret = printed[1] if printed else ""
        return printed is not None

    def says(self, what):
        text = self.log.read_text(encoding="utf-8", errors="replace")
        if self.server.poll() is not None:
            raise RuntimeError(f"the server ended with {self.server.returncode}:\n{text[-1500:]}")
        return what in text

    def stop(self):
        if self.server is None:
            return
        server, self.server = self.server, None
        server.send_signal(signal.SIGTERM)
        try:
            code = server.wait(60)
        except subprocess.TimeoutExpired:
            server.kill()
            code = server.wait()
        if code != 0:
            raise RuntimeError(f"the server ended with {code}:\n" +
                               self.log.read_text(encoding="utf-8", errors="replace")[-1500:])

    # --- actions of a person between two commands -------------------------------------------------

    def prepare(self, command):
        text = command.text
        if text.startswith(("fiducap calibrate", "fiducap replay")):
            self.stop()
        if text.startswith("fiducap calibrate camera"):
            stand_ins.pictures(self.programs, self.folder / command.words()[3])
        elif text.startswith("fiducap calibrate imu") and "--poses" in text:
            stand_ins.in_attitudes(self.folder / command.words()[3])
        elif text.startswith("fiducap calibrate imu"):
            stand_ins.at_rest(self.folder / command.words()[3])
        elif text.startswith("fiducap calibrate extrinsics"):
            stand_ins.simulate(self.programs, self.folder / command.words()[3], "--room", "table",
                               "--seconds", "20")
        elif text.startswith("fiducap import MH_01_easy"):
            stand_ins.simulate(self.programs, self.folder / "MH_01_easy", "--seconds", "2",
                               "--images")
        elif text.startswith("fiducap control freeze"):
            stand_ins.wait_for("three tags in the map", lambda: len(self.page.tags()) >= 3)
        elif text.startswith("fiducap control align"):
            self.measure_tags(self.folder / "measured.csv")
        elif text.startswith("fiducap control stop"):
            frames = self.folder / "recordings/flight-1/robot/mav0/tags0/frames.csv"
            stand_ins.wait_for("images in the recording", lambda: frames.exists() and len(
                frames.read_text(encoding="utf-8").splitlines()) > 100)

    def measure_tags(self, file):
        """As with a total station: the places of the simulated room's tags, of those in the map."""
        stand_ins.simulate(self.programs, self.folder / "room", "--room", "table", "--seconds", "1")
        rows = (self.folder / "room/truth/tags.csv").read_text(encoding="utf-8").splitlines()
        seen = set(self.page.tags())
        with open(file, "w", encoding="utf-8") as out:
            out.write("id,x,y,z\n")
            for fields in (row.split(",") for row in rows if row[:1].isdigit()):
                if int(fields[0]) in seen:
                    out.write(f"{fields[0]},{fields[2]},{fields[3]},{fields[4]}\n")

    # --- the guide against the sources -----------------------------------------------------------

    def compare_steps(self, steps):
        """The guide's table names the steps of the page, in their order and in its words."""
        words = (self.source / "web/src/setup/words.ts").read_text(encoding="utf-8")
        further = (self.source / "web/src/setup/guide_words.ts").read_text(encoding="utf-8")
        shown = [re.search(rf"^  {step}: {{\n    short: '(.+)'", words, re.M).group(1)
                 for step in steps]
        shown += re.findall(r"^    title: '(.+)'", further, re.M)[:3]
        guide = (self.source / "docs/guide.md").read_text(encoding="utf-8")
        table = guide.split("| step | you do |")[1].split("\n\n")[0].splitlines()[2:]
        listed = [row.split("|")[1].strip() for row in table]
        if listed != shown:
            raise ValueError(f"the page has other steps: {shown}\n  the guide: {listed}")


def quoted_words(source):
    """Messages of the server in the guide: they are in the sources."""
    files = [*source.glob("server/**/*.cpp"), *source.glob("server/**/*.hpp")]
    said = "".join(file.read_text(encoding="utf-8") for file in files)
    said = re.sub(r'"\s*\n\s*"', "", said)
    guide = (source / "docs/guide.md").read_text(encoding="utf-8")
    table = guide.split("| you see | message | do |")[1].split("\n\n")[0].splitlines()[2:]
    for row in table:
        for words in re.findall(r"`([^`]+)`", row.split("|")[2]):
            if not words.startswith("fiducap ") and words not in said:
                yield f"docs/guide.md: no message of the server has: {words}"


def links(source, name):
    document = source / name
    for target in re.findall(r"\]\(([^)#\s]+)", document.read_text(encoding="utf-8")):
        if "://" not in target and not (document.parent / target).exists():
            yield f"{name}: a link to nothing: {target}"


def configurations(source):
    """Paths `config/…` in README and documents: of files that exist."""
    for document in (source / "README.md", *sorted(source.glob("docs/**/*.md"))):
        text = document.read_text(encoding="utf-8")
        for path in re.findall(r"(?<![\w/.])(?:\.\./)*(config/[\w./-]*[\w/])", text):
            if not (source / path).exists():
                yield f"{document.relative_to(source)}: there is no {path}"


def look_up_within_lines(walk, name):
    """Commands in a sentence; `fiducap map` alone is a verb."""
    text = (walk.source / name).read_text(encoding="utf-8")
    text = re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)
    for verb in re.findall(r"`\./dev (\w+)", text):
        walk.look_up_dev(name, verb)
    for words in re.findall(r"`(fiducapd? [^`]+)`", text):
        command = Command(name, " ".join(words.split()))
        if re.search(r"…|VERB|COMMAND", words) or walk.words.is_verb_alone(command.words()):
            continue
        walk.look_up(command)


def look_up_all(walk, name):
    """Of a document that is not run: the words of its blocks."""
    document = walk.source / name
    for language, start, lines in blocks(document):
        if language in NO_COMMANDS or lines[0].startswith(PLAIN):
            continue
        for command in commands(name, start, lines):
            if command.program() in PROGRAMS:
                walk.look_up(command)
            elif command.text.startswith("./dev "):
                walk.look_up_dev(command.where, command.words()[1])


def run_all(walk, name):
    document = walk.source / name
    if "export PATH=" not in document.read_text(encoding="utf-8"):
        walk.knows_programs()
    for language, start, lines in blocks(document):
        if language in NO_COMMANDS or (not language and lines[0].startswith(PLAIN)):
            continue
        for command in commands(name, start, lines):
            walk.take(command)
    try:
        walk.stop()
    except RuntimeError as error:
        walk.faults.append(f"{name}: {error}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--only")
    options = parser.parse_args()
    if missing := [tool for tool in TOOLS if shutil.which(tool) is None]:
        print(f"this test did not run: not installed: {', '.join(missing)}")
        return 77
    source, programs = options.source.resolve(), options.programs.resolve()
    faults = [*quoted_words(source), *configurations(source)]
    for name in [one for one in RUN + LOOKED_UP if options.only in (None, one)]:
        with tempfile.TemporaryDirectory(prefix="fiducap_guide_") as folder:
            walk = Walk(source, programs, pathlib.Path(folder))
            try:
                (run_all if name in RUN else look_up_all)(walk, name)
                look_up_within_lines(walk, name)
            finally:
                if walk.server is not None:
                    walk.server.kill()
        print(f"{name}: {walk.ran} commands run, of {walk.looked_up} the words looked up")
        faults += [*walk.faults, *links(source, name)]
        if walk.ran + walk.looked_up == 0:
            faults.append(f"{name}: has not one command")
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
