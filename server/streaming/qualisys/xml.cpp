#include "streaming/qualisys/xml.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace fiducap::qualisys {

namespace {

struct Colour {
  unsigned r, g, b;
};

/// Different for neighbours, constant.
Colour colour_of(std::size_t body) {
  static constexpr std::array<Colour, 6> kColours{{
      {255, 80, 80},
      {80, 200, 120},
      {80, 140, 255},
      {255, 200, 60},
      {200, 100, 255},
      {60, 210, 220},
  }};
  return kColours[body % kColours.size()];
}

// Clients require marker points; these are the ends of the body's axes, 100 mm long.
struct Point {
  int x, y, z;
};
constexpr std::array<Point, 4> kPoints{{{0, 0, 0}, {100, 0, 0}, {0, 100, 0}, {0, 0, 100}}};

void add(std::string& out, std::string_view element, std::string_view value) {
  out.append("<").append(element).append(">").append(value);
  out.append("</").append(element).append(">");
}
void add(std::string& out, std::string_view element, std::size_t value) {
  add(out, element, std::to_string(value));
}

void add_body(std::string& out, const BodyTable::Entry& body, std::size_t index) {
  const Colour c = colour_of(index);
  out += "<Body>";
  add(out, "Name", escape_xml(body.name));
  add(out, "Enabled", body.enabled ? "True" : "False");
  out += "<Color R=\"" + std::to_string(c.r) + "\" G=\"" + std::to_string(c.g) + "\" B=\"" +
         std::to_string(c.b) + "\"/>";
  out +=
      "<MaximumResidual>10</MaximumResidual><MinimumMarkersInBody>3</MinimumMarkersInBody>"
      "<BoneLengthTolerance>5</BoneLengthTolerance><Filter Preset=\"No filter\"/><Points>";
  for (std::size_t i = 0; i < kPoints.size(); ++i)
    out += "<Point X=\"" + std::to_string(kPoints[i].x) + "\" Y=\"" + std::to_string(kPoints[i].y) +
           "\" Z=\"" + std::to_string(kPoints[i].z) + "\" Virtual=\"1\" PhysicalId=\"0\" Name=\"" +
           std::to_string(i + 1) + "\"/>";
  out +=
      "</Points><Data_origin X=\"0\" Y=\"0\" Z=\"0\" Relative_body=\"1\">0</Data_origin>"
      "<Data_orientation R11=\"1\" R12=\"0\" R13=\"0\" R21=\"0\" R22=\"1\" R23=\"0\" R31=\"0\" "
      "R32=\"0\" R33=\"1\" Relative_body=\"1\">0</Data_orientation></Body>";
}

void add_old_body(std::string& out, const BodyTable::Entry& body, std::size_t index) {
  const Colour c = colour_of(index);
  out += "<Body>";
  add(out, "Name", escape_xml(body.name));
  add(out, "RGBColor", c.r + (c.g << 8) + (c.b << 16));
  for (const Point& p : kPoints)
    out += "<Point><X>" + std::to_string(p.x) + "</X><Y>" + std::to_string(p.y) + "</Y><Z>" +
           std::to_string(p.z) + "</Z></Point>";
  out += "</Body>";
}

void add_old_bodies(std::string& out, Version version, std::span<const BodyTable::Entry> bodies) {
  add(out, "Bodies", bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) add_old_body(out, bodies[i], i);
  if (version.minor >= 16)
    out += "<Euler><First>Roll</First><Second>Pitch</Second><Third>Yaw</Third></Euler>";
}

void add_6d(std::string& out, Version version, std::span<const BodyTable::Entry> bodies) {
  out += "<The_6D>";
  if (version.old_parameters()) {
    add_old_bodies(out, version, bodies);
  } else {
    for (std::size_t i = 0; i < bodies.size(); ++i) add_body(out, bodies[i], i);
  }
  out += "</The_6D>";
  // Newer SDKs that ask for an old version (libmotioncapture with a current one: 1.19) look for the
  // old elements outside of The_6D.
  if (version.old_parameters()) add_old_bodies(out, version, bodies);
}

std::string_view upwards(UpAxis up) {
  return up == UpAxis::kDown ? "-Z" : up == UpAxis::kY ? "+Y" : "+Z";
}

void add_3d(std::string& out, UpAxis up) {
  out += "<The_3D>";
  add(out, "AxisUpwards", upwards(up));
  out += "<CalibrationTime></CalibrationTime><Labels>0</Labels></The_3D>";
}

/// Processing steps. `offline`: those of finished captures.
void add_actions(std::string& out, std::string_view element, bool offline) {
  out.append("<").append(element).append(">");
  out += "<PreProcessing2D>false</PreProcessing2D><Tracking>3D</Tracking>";
  if (offline) out += "<TwinSystemMerge>false</TwinSystemMerge><SplineFill>false</SplineFill>";
  out +=
      "<AIM>false</AIM><Track6DOF>true</Track6DOF><ForceData>false</ForceData>"
      "<GazeVector>false</GazeVector>";
  if (offline)
    out +=
        "<ExportTSV>false</ExportTSV><ExportC3D>false</ExportC3D>"
        "<ExportMatlabFile>false</ExportMatlabFile><ExportAviFile>false</ExportAviFile>";
  out.append("</").append(element).append(">");
}

void add_general(std::string& out, double rate_hz) {
  out += "<General>";
  add(out, "Frequency", static_cast<std::size_t>(std::lround(rate_hz)));
  out +=
      "<Capture_Time>0.000000</Capture_Time>"
      "<Start_On_External_Trigger>false</Start_On_External_Trigger>"
      "<Start_On_Trigger_NO>false</Start_On_Trigger_NO>"
      "<Start_On_Trigger_NC>false</Start_On_Trigger_NC>"
      "<Start_On_Trigger_Software>false</Start_On_Trigger_Software>"
      "<External_Time_Base><Enabled>false</Enabled><Signal_Source>Control port</Signal_Source>"
      "<Signal_Mode>Periodic</Signal_Mode><Frequency_Multiplier>1</Frequency_Multiplier>"
      "<Frequency_Divisor>1</Frequency_Divisor><Frequency_Tolerance>1000</Frequency_Tolerance>"
      "<Nominal_Frequency>None</Nominal_Frequency><Signal_Edge>Negative</Signal_Edge>"
      "<Signal_Shutter_Delay>0</Signal_Shutter_Delay>"
      "<Non_Periodic_Timeout>10.000000</Non_Periodic_Timeout></External_Time_Base>"
      "<External_Timestamp><Enabled>false</Enabled><Type>CameraTime</Type>"
      "<Frequency>0</Frequency></External_Timestamp>";
  add_actions(out, "Processing_Actions", true);
  add_actions(out, "RealTime_Processing_Actions", false);
  add_actions(out, "Reprocessing_Actions", true);
  out += "<EulerAngles First=\"Roll\" Second=\"Pitch\" Third=\"Yaw\"/></General>";
}

constexpr std::size_t kMaxBodies = 1000;
constexpr std::size_t kMaxDepth = 16;

constexpr std::array<std::pair<std::string_view, char>, 5> kEntities{
    {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}}};

std::string unescape_xml(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    std::size_t used = 1;
    char c = text.front();
    for (const auto& [entity, meaning] : kEntities) {
      if (!text.starts_with(entity)) continue;
      c = meaning;
      used = entity.size();
    }
    out += c;
    text.remove_prefix(used);
  }
  return out;
}

/// An opening or closing tag and the characters before it.
struct Tag {
  std::string_view before;
  std::string_view name;
  bool opens{false};
  bool closes{false};
  bool is_other{false};  ///< A declaration or comment.
};

/// @return nullopt when the tag has no end or no name
/// @pre rest has one
std::optional<Tag> take_tag(std::string_view& rest) {
  const auto begin = rest.find('<');
  const auto end = rest.find('>', begin);
  if (end == std::string_view::npos) return std::nullopt;
  Tag tag;
  tag.before = rest.substr(0, begin);
  std::string_view inside = rest.substr(begin + 1, end - begin - 1);
  rest.remove_prefix(end + 1);
  tag.is_other = inside.starts_with('?') || inside.starts_with('!');
  if (tag.is_other) return tag;
  tag.closes = inside.starts_with('/') || inside.ends_with('/');
  tag.opens = !inside.starts_with('/');
  if (inside.starts_with('/')) inside.remove_prefix(1);
  tag.name = inside.substr(0, inside.find_first_of(" \t\r\n/"));
  return tag.name.empty() ? std::nullopt : std::optional(tag);
}

/// Reads the elements Body/Name and Body/Enabled.
class SettingsReader final {
 public:
  /// @return false: nested too deeply, closed without being open, too many bodies
  bool take(const Tag& tag) {
    if (tag.opens) {
      if (path_.size() >= kMaxDepth) return false;
      path_.push_back(tag.name);
      if (in_body() && path_.back() == "Body") name_.reset(), enabled_.reset();
    }
    if (!tag.closes) return true;
    if (path_.empty() || path_.back() != tag.name) return false;
    leave(tag.opens ? std::string_view{} : tag.before);
    path_.pop_back();
    return found.size() <= kMaxBodies;
  }
  [[nodiscard]] bool whole() const { return path_.empty(); }
  std::vector<BodySwitch> found;

 private:
  [[nodiscard]] bool in_body() const {
    return path_.size() >= 2 && path_[path_.size() - 2] == "The_6D";
  }
  void leave(std::string_view text) {
    const bool field = path_.size() >= 3 && path_[path_.size() - 2] == "Body" &&
                       path_[path_.size() - 3] == "The_6D";
    if (field && path_.back() == "Name") name_ = unescape_xml(text);
    if (field && path_.back() == "Enabled") enabled_ = same_word(text, "true");
    if (in_body() && path_.back() == "Body" && name_ && enabled_)
      found.push_back({*name_, *enabled_});
  }

  std::vector<std::string_view> path_;
  std::optional<std::string> name_;
  std::optional<bool> enabled_;
};

}  // namespace

std::string escape_xml(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto entity = std::ranges::find(kEntities, c, &std::pair<std::string_view, char>::second);
    if (entity != kEntities.end()) {
      out += entity->first;
    } else {
      out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '_' : c;
    }
  }
  return out;
}

std::string parameters_xml(const ParameterGroups& groups, Version version,
                           std::span<const BodyTable::Entry> bodies, UpAxis up, double rate_hz) {
  const std::string root = "QTM_Parameters_Ver_1." + std::to_string(version.minor);
  std::string out = "<" + root + ">";
  if (groups.general) add_general(out, rate_hz);
  if (groups.three_d) add_3d(out, up);
  if (groups.six_d) add_6d(out, version, bodies);
  return out + "</" + root + ">";
}

std::optional<std::vector<BodySwitch>> parse_body_switches(std::string_view xml) {
  SettingsReader reader;
  while (xml.find('<') != std::string_view::npos) {
    const auto tag = take_tag(xml);
    if (!tag || (!tag->is_other && !reader.take(*tag))) return std::nullopt;
  }
  if (!reader.whole()) return std::nullopt;
  return std::move(reader.found);
}

}  // namespace fiducap::qualisys
