#!/usr/bin/env python3
"""Writes docs/reference.md from the sources: make_reference.py [--check].

Keys are those of the `describe` functions of server/, defaults and meanings those of the members of the
structs. A key without any meaning is an error, and a meaning with words of the code.
`--check`: exit code 1 when the file differs.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = ROOT / "docs/reference.md"
TOP = "ServerConfig"
# Structs with a member for each word of their `type`; the keys of the chosen one are beside `type`.
VISITED = ("SourceConfig", "CameraSourceConfig", "ImuSourceConfig")
# By struct and key, or by key alone.
DEFAULTS = {("RoomConfig", "gravity_m_s2"): "9.81"}
# Words of the code, which a user of the file does not know.
FOREIGN = r"nullopt|\w::\w|\bk[A-Z][a-z]+"


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
            # What follows `return` belongs to a function.
            if declared and "static" not in statement and declared["type"] != "return":
                for one in re.finditer(r"(\w+)\s*(?:\{((?:[^{}]|\{[^{}]*\})*)\}|=\s*([^,]*))?(?:,\s*|$)",
                                       declared["names"]):
                    default = one.group(2) if one.group(2) is not None else one.group(3) or ""
                    meaning_text = plain(" ".join(pending + meaning))
                    members.setdefault(one.group(1),
                                       (declared["type"], plain(default), meaning_text))
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
        arrays = re.findall(r"array<[\w:]*?Word<([\w:]+)>, \d+> \w+\{(.*?)\};", text, re.S)
        for enum, body in arrays:
            words[enum.split("::")[-1]] = re.findall(r"\"([\w-]+)\"", body)
    lines = ["# Configuration keys", "",
             "Written by `docs/make_reference.py` from the sources. `fiducapd --config FILE --print-config` shows",
             "all values of a configuration; `--set path.to.key=value` changes one for a single run.", ""]
    protocols = re.search(r"set\(protocols ([\w ]+)\)", (ROOT / "server/streaming/CMakeLists.txt").read_text()).group(1)
    done, empty = {}, []

    def member_of(struct, name):
        *parts, member = name.removesuffix(".front").split(".")
        for part in parts:
            struct = inner(all_structs[struct][1][part][0])
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
                if not choices:
                    empty.append(f"{struct}.{key} (its words)")
                meaning = (", ".join(f"`{word}`" for word in choices) + ". " + meaning).strip()
                default = ""
            default = DEFAULTS.get((struct, key), default)
            default = default.replace("Eigen::Vector3d::Zero()", "0, 0, 0")
            if not meaning:
                empty.append(f"{struct}.{key}")
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
                lines.extend([f"The keys of `{done[struct]}`, see above.", ""])
            else:
                if comment:
                    lines.extend([comment, ""])
                lines.extend(["| key | default | meaning |", "|---|---|---|", *body, ""])
        again = struct in done
        done.setdefault(struct, path)
        if again:
            return
        visited = words[inner(all_structs[struct][1]["type"][0])] if struct in VISITED else []
        for kind in visited:
            declared, default, _ = all_structs[struct][1][kind]
            source, here = inner(declared), f"{path}` with `type: {kind}"
            inner_later = []
            inner_body = rows(source, inner_later, path + ".")
            if not inner_body:
                continue
            lines.extend([f"### `{here}`", ""])
            if source in done:
                lines.extend([f"The keys of `{done[source]}`, see above."
                              + (f" Default of the first: `{default}`." if default else ""), ""])
                continue
            done[source] = here
            if default:
                inner_body[0] = inner_body[0].replace(" |  | ", f" | `{default}` | ", 1)
            if all_structs[source][0]:
                lines.extend([all_structs[source][0], ""])
            lines.extend(["| key | default | meaning |", "|---|---|---|", *inner_body, ""])
            later.extend(inner_later)
        for name, inner_struct in later:
            section(name, inner_struct)

    section("", TOP)
    text = "\n".join(lines).rstrip() + "\n"
    names = "|".join(name for name in all_structs if re.match("[A-Z][a-z]+[A-Z]", name))
    empty += re.findall(rf"{FOREIGN}|\b(?:{names})\b", text)
    if empty:
        print("no meaning in the sources, or a word of the code: " + ", ".join(dict.fromkeys(empty)))
        return 1
    if "--check" in sys.argv:
        if TARGET.read_text(encoding="utf-8") != text:
            print("docs/reference.md differs from the sources: run docs/make_reference.py")
            return 1
        return 0
    TARGET.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
