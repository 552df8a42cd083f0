#!/usr/bin/env python3
"""Writes docs/reference.md from the sources: make_reference.py [--check].

Keys are those of the `describe` functions of server/, defaults and meanings those of the members of the
structs. `--check`: exit code 1 when the file differs.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = ROOT / "docs/reference.md"
# Which struct a section or list holds when the name of its member does not say it; by struct and key.
TOP = "ServerConfig"
VISITED = {"SourceConfig": ["SimulatedBodyConfig", "RecordingSourceConfig", "CameraDeviceConfig",
                            "RosSourceConfig"],
           "CameraSourceConfig": ["CameraDeviceConfig", "RosCameraConfig"]}


def plain(text):
    return re.sub(r"\s+", " ", text).strip()


def structs(text):
    """By name: (comment, members) of the structs of one header; a member: type, default, meaning."""
    found = {}
    for match in re.finditer(r"((?:^///[^\n]*\n)*)^struct (\w+)(?: final)?(?: : ([\w:, ]+))? \{\n(.*?)^\};",
                             text, re.M | re.S):
        comment, name, bases, body = match.groups()
        members, pending = {}, []
        # A declaration may span lines; `///<` after it continues on lines that begin with `///<`.
        statement, meaning = "", []

        def finish():
            nonlocal statement, meaning, pending
            declared = re.match(r"(?:static constexpr )?(?P<type>[\w:<>, ]+?)\s+(?P<names>\w+(?:\s*"
                                r"(?:\{[^;]*\}|=[^;]*)?)(?:,\s*\w+(?:\{[^;]*\})?)*);$", plain(statement))
            if declared and "static" not in statement:
                for one in re.finditer(r"(\w+)\s*(?:\{((?:[^{}]|\{[^{}]*\})*)\}|=\s*([^,]*))?(?:,\s*|$)",
                                       declared["names"]):
                    default = one.group(2) if one.group(2) is not None else one.group(3) or ""
                    members[one.group(1)] = (declared["type"], plain(default), plain(" ".join(pending + meaning)))
            statement, meaning, pending = "", [], []

        for line in body.splitlines():
            text_line = line.strip()
            if text_line.startswith("///<"):
                meaning.append(text_line[4:])
                continue
            if text_line.startswith("///"):
                if statement.endswith(";"):
                    finish()
                pending.append(text_line[3:])
                continue
            if not text_line or text_line.startswith(("//", "[[", "friend", "}", "#")):
                if statement.endswith(";"):
                    finish()
                statement, meaning, pending = "", [], []
                continue
            if statement.endswith(";"):
                finish()
            code, _, tail = text_line.partition("///<")
            statement = plain(statement + " " + code)
            if tail:
                meaning.append(tail)
        if statement.endswith(";"):
            finish()
        found[name] = (plain(" ".join(line[3:] for line in comment.splitlines())),
                       members, [plain(base.replace("public", "")) for base in (bases or "").split(",") if base])
    return found


def described(text):
    """By struct: the calls of its `describe`: (kind, key, member)."""
    found = {}
    for match in re.finditer(r"void describe\(V&(?: v)?, ([\w:]+)&(?: c)?\) \{(.*?)^\}", text, re.M | re.S):
        name = match.group(1).split("::")[-1]
        calls = re.findall(r"v\.(value|word|seconds|path|secret|device|section|optional_section|list)\(\s*\"(\w+)\","
                           r"\s*c\.([\w.]+)|describe\(v, (?:c\.(\w+)|static_cast<(\w+)&>\(c\))\)", match.group(2))
        found[name] = [(kind or "same", key, member or same or base) for kind, key, member, same, base in calls]
    return found


def main():
    all_structs, all_described, words = {}, {}, {}
    for path in sorted((ROOT / "server").rglob("*.hpp")):
        text = path.read_text(encoding="utf-8")
        for name, found in structs(text).items():
            all_structs.setdefault(name, found)
        for name, calls in described(text).items():
            all_described.setdefault(name, calls)
        for enum, body in re.findall(r"array<(?:words::)?Word<([\w:]+)>, \d+> \w+\{(.*?)\};", text, re.S):
            words[enum.split("::")[-1]] = re.findall(r"\"(\w+)\"", body)
    lines = ["# Configuration keys", "",
             "Written by `docs/make_reference.py` from the sources. `fiducapd --config FILE --print-config` shows",
             "all values of a configuration; `--set path.to.key=value` changes one for a single run.", ""]
    protocols = re.search(r"set\(protocols ([\w ]+)\)", (ROOT / "server/streaming/CMakeLists.txt").read_text()).group(1)
    done = set()

    def member_of(struct, name):
        for part in name.split(".")[:-1]:
            struct = inner(all_structs[struct][1][part][0])
        member = name.split(".")[-1]
        for one in [struct] + [base.split("::")[-1] for base in all_structs.get(struct, ("", {}, []))[2]]:
            if member in all_structs.get(one, ("", {}, []))[1]:
                return all_structs[one][1][member]
        return ("", "", "")

    def inner(declared):
        return re.sub(r".*<|>.*", "", declared).split("::")[-1].strip()

    def rows(struct, later, path):
        result = []
        for kind, key, member in all_described.get(struct, []):
            if kind == "same":
                target = member if member in all_described else inner(member_of(struct, member)[0])
                if struct not in VISITED:
                    result += rows(target, later, path)
                continue
            declared, default, meaning = member_of(struct, member)
            if kind in ("section", "list", "optional_section"):
                later.append((f"{path}{key}" + ("[]" if kind == "list" else ""), inner(declared)))
                meaning = meaning or {"section": "section, see below", "list": "list, see below",
                                      "optional_section": "optional section, see below"}[kind]
                default = ""
            if kind == "word":
                choices = words.get(declared.split("::")[-1], [])
                meaning = (", ".join(f"`{word}`" for word in choices) + ". " + meaning).strip()
                default = ""
            default = default.replace("std::", "").replace("|", "\\|")
            result.append(f"| `{key}` | {f'`{default}`' if default else ''} | {meaning.replace('|', chr(92) + '|')} |")
        return result

    def section(path, struct):
        later = []
        body = rows(struct, later, path + "." if path else "")
        if struct == "StreamingConfig":
            for protocol in protocols.split():
                header = (ROOT / f"server/streaming/{protocol}/{protocol}.hpp").read_text(encoding="utf-8")
                config = re.search(r"using ProtocolConfig = (\w+);", header).group(1)
                body.append(f"| `{protocol}` |  | section, see below |")
                later.append((f"streaming.{protocol}", config))
        if body:
            lines.extend([f"## `{path}`" if path else "## Top level", ""])
            comment = all_structs.get(struct, ("",))[0]
            if struct in done:
                lines.extend([f"The keys of `{struct}`, see above.", ""])
            else:
                if comment:
                    lines.extend([comment, ""])
                lines.extend(["| key | default | meaning |", "|---|---|---|", *body, ""])
        again = struct in done
        done.add(struct)
        if again:
            return
        for source in VISITED.get(struct, []):
            inner_later = []
            inner_body = rows(source, inner_later, path + ".")
            kind = {"SimulatedBodyConfig": "simulator", "RecordingSourceConfig": "recording",
                    "CameraDeviceConfig": "camera"}.get(source, "ros")
            if source in done:
                continue
            done.add(source)
            lines.extend([f"### `{path}` with `type: {kind}`", "", all_structs[source][0], "",
                          "| key | default | meaning |", "|---|---|---|", *inner_body, ""])
            later.extend(inner_later)
        for name, inner_struct in later:
            section(name, inner_struct)

    section("", TOP)
    text = "\n".join(lines).rstrip() + "\n"
    if "--check" in sys.argv:
        if TARGET.read_text(encoding="utf-8") != text:
            print("docs/reference.md differs from the sources: run docs/make_reference.py")
            return 1
        return 0
    TARGET.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
