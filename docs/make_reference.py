#!/usr/bin/env python3
"""Writes docs/reference.md from the sources: make_reference.py [--check].

Keys are those of the `describe` functions of server/, defaults and meanings those of the members of the
structs; MEANINGS has those of members without a comment. A key without any meaning is an error.
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
DEFAULTS = {("MapSettings", "refine_period_s"): "2, or 0 with one body",
            ("RoomConfig", "gravity_m_s2"): "9.81"}
# Words of comments that a user does not know, and what the page has in their place.
REWORDED = {"kSensors if only `cameras` and the IMU have sources.":
                "`type: sensors` if `cameras` and `imu_source` have sources of their own.",
            "Its own; nullopt: the body's.": "Its own; without it: the body's `source`.",
            "nullopt: the recording's or the simulator's own.":
                "Without it: the noise that recording or simulator state.",
            ", see Streamer::port": "",
            "An alias must obey check_body_name.":
                "Names for the clients, by name of the body; with the rules of names of bodies.",
            "Reply to `Client::discover()`.": "Reply to clients that search for servers.",
            "Domain, interface and peers: NetworkConfig.":
                "Domain, interface and peers: section `dds`.",
            "the IMU's densities come with the body (ImuNoise)":
                "the IMU's densities come with the body (`bodies[].imu`)",
            "only lenses with configured sigmas (CameraMount)":
                "only lenses with a `focal_sigma`, `centre_sigma_px` or `k1_sigma`",
            " (MapRefiner)": "",
            "Densities as in ImuNoise.": "Densities as in `bodies[].imu`.",
            "See `part_names`; other": "Name of a chip, camera or autopilot, e.g. `bmi088`; other",
            "Per camera of the body: sensor_msgs/Image;":
                "A topic per camera of the body: sensor_msgs/Image;"}
FOREIGN = r"nullopt|\w::\w|\bk[A-Z][a-z]+|WorkspaceGauge"
MEANINGS = {
    "enabled": "False: this protocol is not served.",
    "aliases": "Names for the clients, by name of the body.",
    ("MapSettings", "floor_tags"): "Tags that lie flat, face up: bodies without IMU wait for all "
                                   "of them and take the vertical from them.",
    ("MapSettings", "reference_tag"): "Defines the origin; without it: the first tag that is seen.",
    "max_clients": "Further clients are refused.",
    "max_clients_per_address": "Further clients of the same address are refused.",
    ("BodyConfig", "name"): "In all protocols and in the folders of recordings.",
    ("BodyConfig", "filter"): "`world`, or `robocentric` (that of the RCARS paper).",
    ("BodyConfig", "use_imu"): "False: readings of an IMU are not used.",
    ("BodyLimits", "max_position_sigma_m"): "A pose with a larger sigma is invalid (worst axis).",
    ("BodyLimits", "max_rotation_sigma_rad"): "The same for the attitude.",
    ("CameraDeviceConfig", "height"): "As `width`.",
    ("CameraModel", "width"): "Of the images, pixels.",
    ("CameraModel", "height"): "Of the images, pixels.",
    ("CameraModel", "coefficients"): "Of the distortion, in OpenCV's order.",
    ("CameraMount", "rotation_sigma_rad"): "Of X_BV, per axis.",
    ("CameraMount", "time_shift_sigma_s"): "Of `time_shift_s`.",
    ("CameraMount", "readout_sigma_s"): "Of `readout_s`.",
    ("CameraMount", "rate_hz"): "Images per second.",
    ("DaylightConfig", "low"): "Corner with the smallest x, y, z, m.",
    ("DaylightConfig", "high"): "Corner with the largest x, y, z, m.",
    ("DdsConfig", "px4_rate_hz"): "Messages per second to PX4, at most.",
    ("DetectorConfig", "blur_sigma_px"): "Gaussian blur before detection; 0: none.",
    ("DetectorConfig", "min_decision_margin"): "Detections with a smaller margin are not used.",
    ("DetectorConfig", "refine_edges"): "Moves the sides to the steepest gradient (libapriltag).",
    ("ExtraSensor", "X_PS"): "Pose of the sensor in axes of the pivot.",
    ("FaultConfig", "blackout_s"): "Duration of a blackout.",
    ("FaultConfig", "drop_imu"): "Share of IMU samples that are lost.",
    ("FaultConfig", "moved_at_s"): "Time of the jump.",
    ("FaultConfig", "saturated_accel_m_s2"): "Limit per axis in this interval.",
    ("ImuErrors", "accel_bias"): "At the start, m/s².",
    ("ImuErrors", "accel_range_m_s2"): "Saturation.",
    ("ImuErrors", "gyro_bias"): "At the start, rad/s.",
    ("ImuNoise", "accel_noise_m_s2_rtHz"): "White noise of the accelerometer.",
    ("ImuNoise", "accel_range_m_s2"): "The same for the accelerometer.",
    ("ImuNoise", "accel_walk_m_s3_rtHz"): "Random walk of the accelerometer's bias.",
    ("ImuNoise", "gyro_noise_rad_s_rtHz"): "White noise of the gyroscope.",
    ("ImuNoise", "gyro_walk_rad_s2_rtHz"): "Random walk of the gyroscope's bias.",
    ("ImuNoise", "rate_hz"): "Samples per second.",
    ("ImuTopicConfig", "topic"): "Name of the topic.",
    ("NatNetConfig", "multicast_group"): "Destination of multicast frames.",
    ("NatNetConfig", "multicast_ttl"): "1: this network only.",
    ("NativeConfig", "address"): "Where it listens. 0.0.0.0: all interfaces.",
    ("NativeConfig", "multicast_port"): "Of multicast frames.",
    ("RecordedTag", "X_WT"): "Pose of the tag.",
    ("RecordedTag", "edge_m"): "Edge of the black square.",
    ("RecordedTag", "position_sigma_m"): "Of X_WT, per axis.",
    ("RecordedTag", "rotation_sigma_rad"): "Of X_WT, per axis.",
    ("RecordedTag", "tag_id"): "Number of the tag in its family.",
    ("RecordingSourceConfig", "folder"): "Of the recording.",
    ("RecordingSourceConfig", "loop"): "Start again at the end.",
    ("RecordingSourceConfig", "speed"): "2: twice as fast as it was recorded.",
    ("RingConfig", "tags"): "Number of tags.",
    ("RoomConfig", "family"): "Of the room's tags.",
    ("RoomConfig", "gravity_m_s2"): "Of the room.",
    ("RosCameraConfig", "image"): "sensor_msgs/Image; CompressedImage if it ends in `/compressed`.",
    ("SimulatedBodyConfig", "seed"): "Of the sensors' random numbers.",
    ("StreamingConfig", "rate_hz"): "Frames per second to all clients (some protocols have lower "
                                    "limits of their own).",
    ("TagSetConfig", "family"): "`tag36h11`, another one of libapriltag, or `DICT_…` of ArUco.",
    ("TagSetConfig", "sizes_m"): "By tag id, for tags with another size than `size_m`.",
    ("TrajectoryConfig", "seed"): "Of the motion's random numbers.",
    ("TrajectoryConfig", "share"): "See `from`.",
    ("VehicleConfig", "address"): "Of the autopilot.",
    ("VehicleConfig", "body"): "Name of its body.",
    ("VehicleConfig", "rate_hz"): "Poses per second to this autopilot, at most.",
    ("VrpnConfig", "acceleration"): "Also send accelerations.",
    ("VrpnConfig", "velocity"): "Also send velocities.",
    ("WebConfig", "address"): "Where it listens. 0.0.0.0: all interfaces.",
}


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
                if not choices:
                    empty.append(f"{struct}.{key} (its words)")
                meaning = (", ".join(f"`{word}`" for word in choices) + ". " + meaning).strip()
                default = ""
            if not meaning or meaning == "WorkspaceGauge":
                meaning = MEANINGS.get((struct, key)) or MEANINGS.get(key, "")
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
    for word, plainer in REWORDED.items():
        if word not in text:
            empty.append(f"REWORDED, which nothing needs: {word}")
        text = text.replace(word, plainer)
    if foreign := re.search(FOREIGN, text):
        empty.append(f"REWORDED, which lacks: {foreign[0]}")
    if empty:
        print("no meaning in the sources or in MEANINGS, or a word of the code: "
              + ", ".join(dict.fromkeys(empty)))
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
