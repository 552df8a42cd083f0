"""Shell commands of a document, and whether their words are right."""
import re
import shlex
import subprocess

PROGRAMS = ("fiducap", "fiducapd")
NEEDS = re.compile(r"#\s*(needs .*)$")


class Command:
    """One line of a shell block."""

    def __init__(self, where, text):
        self.where = where
        needs = NEEDS.search(text)
        self.needs = needs.group(1) if needs else ""
        self.text = re.sub(r"\s+#\s.*$", "", text).strip()

    def words(self):
        return shlex.split(self.text)

    def program(self):
        """Its file name, without settings for it alone: `A=b ./bin/fiducap` is fiducap."""
        for word in self.text.split():
            if not re.match(r"^\w+=", word):
                return word.rsplit("/", 1)[-1]
        return ""


def blocks(document):
    """Language, first line's number and lines of every fenced block."""
    language, start, lines = None, 0, []
    for number, line in enumerate(document.read_text(encoding="utf-8").splitlines(), 1):
        fence = re.match(r"^```(\S*)\s*$", line)
        if fence and language is None:
            language, start, lines = fence.group(1), number + 1, []
        elif fence:
            yield language, start, lines
            language = None
        elif language is not None:
            lines.append(line)
    if language is not None:
        raise ValueError(f"{document}:{start}: a block that does not end")


def commands(where, start, lines):
    """Joins lines that end in a backslash; leaves out lines of comments."""
    joined, first = "", start
    for number, line in enumerate(lines, start):
        if not joined:
            first = number
        joined += line
        if joined.endswith("\\"):
            joined = joined[:-1] + " "
            continue
        if joined.strip() and not joined.lstrip().startswith("#"):
            yield Command(f"{where}:{first}", joined)
        joined = ""


class Words:
    """Verbs and options of the programs, by their --help."""

    def __init__(self, programs):
        self.programs = programs
        self.helps = {}

    def help_of(self, command):
        key = " ".join(map(str, command))
        if key not in self.helps:
            run = subprocess.run([*command, "--help"], capture_output=True, text=True, check=False)
            if run.returncode != 0:
                raise ValueError(f"{key} --help: {run.stderr}")
            self.helps[key] = run.stdout
        return self.helps[key]

    def fault(self, words):
        """Faults of a command of fiducap, fiducapd or a script; empty: none."""
        name = words[0].rsplit("/", 1)[-1]
        known = name in PROGRAMS
        command, rest = [self.programs / name if known else words[0]], words[1:]
        try:
            while "Subcommands:" in self.help_of(command):
                if rest and rest[0].startswith("-"):
                    break
                if not rest or not self.is_verb(command, rest[0]):
                    return f"no verb of {' '.join(words[:len(command)])}: {rest[:1]}"
                command, rest = command + [rest[0]], rest[1:]
            text = self.help_of(command)
        except (OSError, ValueError) as error:
            return str(error)
        for word in rest:
            option = word.split("=")[0]
            if re.match(r"^--?[a-z]", word) and not re.search(rf"(^|[\s,\[]){option}\b", text):
                return f"no option of {' '.join(map(str, command))}: {option}"
        return ""

    def is_verb_alone(self, words):
        """`fiducap map`: a group of verbs, named as such."""
        return len(words) == 2 and words[0] == "fiducap" and self.is_verb(
            [self.programs / "fiducap"], words[1])

    def is_verb(self, command, word):
        listed = self.help_of(command).split("Subcommands:", 1)[1]
        return re.search(rf"^  {re.escape(word)} ", listed, re.M) is not None
