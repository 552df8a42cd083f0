// Marker maps of the ArUco library. Its TAG… dictionaries print as libapriltag does, so its
// top-left corner is ours. OpenCV's DICT_APRILTAG_… print the same tags turned by half a turn.
#include <array>
#include <cmath>

#include <Eigen/SVD>

#include "detection/tag_family.hpp"
#include "detection/tag_geometry.hpp"
#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/yaml_place.hpp"

namespace fiducap {

namespace {

using MarkerCorners = std::array<Eigen::Vector3d, 4>;  ///< Clockwise from the top-left.

constexpr int kInPixels = 0;
constexpr int kInMetres = 1;
constexpr double kSquare = 0.01;    // farther from one, in edges: corners of something else
constexpr double kSameSize = 0.02;  // of marker maps in pixels, which are rounded
// Dictionaries of libapriltag's families: TAG36h11 of ArUco, DICT_APRILTAG_36h11 of OpenCV, …
constexpr std::string_view kOfAruco = "TAG";
constexpr std::string_view kOfOpenCv = "DICT_APRILTAG_";
constexpr std::array<std::string_view, 4> kFamilies{"36h11", "36h10", "25h9", "16h5"};

std::string joined(std::string_view prefix, std::string_view family) {
  return std::string(prefix) + std::string(family);
}

/// The square whose corners are nearest to the given ones.
struct Marker {
  int id{};
  double edge{};  ///< In the file's unit, like the pose.
  Pose X_WT;
};

/// OpenCV before version 4 wrote `{ id:7, corners:[`, which is not YAML: inserts the blank.
std::string with_blanks(const std::string& text) {
  std::string out;
  out.reserve(text.size() + text.size() / 16);
  const std::string_view view = text;
  for (std::size_t i = 0; i < view.size(); ++i) {
    for (const std::string_view key : {"id:", "corners:"}) {
      if (!view.substr(i).starts_with(key)) continue;
      const bool begins = i == 0 || view[i - 1] == ' ' || view[i - 1] == '{' || view[i - 1] == ',';
      if (!begins) continue;
      out += key;
      out += ' ';
      i += key.size();
    }
    if (i < view.size()) out += view[i];
  }
  return out;
}

MarkerCorners corners_of(const YamlPlace& place) {
  const auto entries = place.entries();
  if (entries.size() != 4)
    place.refuse("has " + std::to_string(entries.size()) + " corners: must be 4");
  MarkerCorners corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto xyz = entries[i].entries();
    if (xyz.size() != 3)
      entries[i].refuse("has " + std::to_string(xyz.size()) + " numbers: must be x, y and z");
    corners[i] = {xyz[0].number(), xyz[1].number(), xyz[2].number()};
  }
  return corners;
}

/// In the order of MarkerCorners.
Eigen::Vector3d marker_corner(std::size_t i, double edge) {
  return tag_corner(3 - static_cast<int>(i), edge);
}

/// Least squares.
Marker fitted(const MarkerCorners& corners, const YamlPlace& place) {
  Marker marker;
  marker.X_WT.p = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
  Eigen::Matrix<double, 3, 2> sides;
  sides << corners[1] - corners[0] + corners[2] - corners[3],
      corners[0] - corners[3] + corners[1] - corners[2];
  if (!sides.allFinite()) place.refuse("has no size");
  const Eigen::JacobiSVD<Eigen::Matrix<double, 3, 2>> svd(
      sides, Eigen::ComputeFullU | Eigen::ComputeFullV);
  marker.edge = 0.25 * svd.singularValues().sum();
  if (!std::isfinite(marker.edge) || marker.edge <= 0) place.refuse("has no size");
  Eigen::Matrix3d R_WT;
  R_WT.leftCols<2>() = svd.matrixU().leftCols<2>() * svd.matrixV().transpose();
  R_WT.col(2) = R_WT.col(0).cross(R_WT.col(1));
  marker.X_WT.q = Eigen::Quaterniond(R_WT).normalized();
  double worst = 0;
  for (std::size_t i = 0; i < 4; ++i)
    worst = std::max(
        worst, (marker.X_WT * marker_corner(i, marker.edge) - corners[i]).norm() / marker.edge);
  if (!(worst <= kSquare))
    place.refuse("a corner is " + shortest(100 * worst) +
                 " % of the edge away from a square: must be at most 1");
  return marker;
}

std::vector<std::pair<Marker, YamlPlace>> read_markers(const YamlPlace& top) {
  const int count = top.at("aruco_bc_nmarkers").integer();
  const auto entries = top.at("aruco_bc_markers").entries();
  if (std::to_string(count) != std::to_string(entries.size()))
    top.at("aruco_bc_nmarkers")
        .refuse("is " + std::to_string(count) + ", but aruco_bc_markers has " +
                std::to_string(entries.size()) + " entries");
  std::vector<std::pair<Marker, YamlPlace>> markers;
  markers.reserve(entries.size());
  for (const YamlPlace& place : entries) {
    place.only({"id", "corners"});
    Marker marker = fitted(corners_of(place.at("corners")), place.at("corners"));
    marker.id = place.at("id").integer();
    markers.emplace_back(marker, place);
  }
  return markers;
}

/// Metres per unit of the file.
double scale_of(const YamlPlace& unit, const std::vector<std::pair<Marker, YamlPlace>>& markers,
                const MapImportOptions& options, std::vector<std::string>& remarks) {
  const int type = unit.integer();
  if (type == kInMetres) return 1;
  if (type != kInPixels)
    unit.refuse("is " + std::to_string(type) + ": must be 1 (metres) or 0 (pixels)");
  if (!options.edge_m)
    unit.refuse("is 0: the corners are in pixels, so their size is unknown; add --tag-size METRES");
  if (markers.empty()) return 1;
  const Marker& first = markers.front().first;
  for (const auto& [marker, place] : markers) {
    if (std::abs(marker.edge - first.edge) <= kSameSize * first.edge) continue;
    place.refuse("marker " + std::to_string(marker.id) + " is " + shortest(marker.edge) +
                 " pixels large, marker " + std::to_string(first.id) + " " + shortest(first.edge) +
                 ": one --tag-size cannot be right for both");
  }
  remarks.push_back("the file is in pixels: " + shortest(first.edge) + " of them are taken as " +
                    shortest(*options.edge_m) + " m");
  return *options.edge_m / first.edge;
}

/// Family of the dictionary; an unknown one stays.
std::string family_of(const std::string& dictionary) {
  for (const std::string_view one : kFamilies)
    if (dictionary == joined(kOfAruco, one) || dictionary == joined(kOfOpenCv, one))
      return joined("tag", one);
  return listed_tag_family(dictionary);
}

ImportedMap read_aruco(const YamlPlace& top, const MapImportOptions& options) {
  top.only({"aruco_bc_dict", "aruco_bc_nmarkers", "aruco_bc_mInfoType", "aruco_bc_markers"});
  std::vector<std::string> remarks;
  const std::string dictionary =
      top.has("aruco_bc_dict") ? top.at("aruco_bc_dict").text() : std::string();
  const std::string family = family_of(dictionary);
  const bool is_turned = dictionary.starts_with(kOfOpenCv);
  if (is_turned)
    remarks.push_back("OpenCV prints " + dictionary +
                      " turned by half a turn: the tags are turned back");
  const auto markers = read_markers(top);
  const double scale = scale_of(top.at("aruco_bc_mInfoType"), markers, options, remarks);
  ForeignTags tags;
  for (const auto& [marker, place] : markers) {
    KnownTag tag;
    tag.tag_id = marker.id;
    tag.edge_m = scale == 1 ? marker.edge : *options.edge_m;
    tag.X_WT = {marker.X_WT.q, scale * marker.X_WT.p};
    if (is_turned) tag.X_WT.q = tag.X_WT.q * Eigen::Quaterniond(0, 0, 0, 1);
    tags.add(tag, place);
  }
  return tags.take(family, std::move(remarks));
}

std::string aruco_name(const std::string& family) {
  for (const std::string_view one : kFamilies)
    if (family == joined("tag", one)) return joined(kOfAruco, one);
  const TagFamilyFacts* listed = find_tag_family(family);
  return listed != nullptr && listed->dictionary >= 0 ? family : std::string();
}

}  // namespace

Expected<ImportedMap> map_from_aruco_yaml(const std::string& text, const MapImportOptions& options,
                                          const std::string& context) {
  if (auto fits = check_length(text, context); !fits) return tl::unexpected<Error>(fits.error());
  return read_foreign_yaml(with_blanks(text), options, context,
                           [&](const YamlPlace& top) { return read_aruco(top, options); });
}

ExportedMap map_to_aruco_yaml(const TagMap& map) {
  ExportedMap exported;
  const auto tags = tags_to_export(map, {}, exported.remarks);
  std::string& text = exported.text;
  text = "%YAML:1.0\n---\n";
  if (const std::string name = aruco_name(map.family); !name.empty())
    text += "aruco_bc_dict: " + name + "\n";
  else
    exported.remarks.push_back("ArUco has no dictionary of the family " + map.family);
  text += "aruco_bc_nmarkers: " + std::to_string(tags.size()) + "\naruco_bc_mInfoType: 1\n";
  text += tags.empty() ? "aruco_bc_markers: []\n" : "aruco_bc_markers:\n";
  for (const MapTag* entry : tags) {
    text += "   - { id: " + std::to_string(entry->tag.tag_id) + ", corners: [ ";
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d corner = entry->tag.X_WT * marker_corner(i, entry->tag.edge_m);
      text += (i == 0 ? "[ " : ",\n       [ ") + to_point_text(corner.x()) + ", " +
              to_point_text(corner.y()) + ", " + to_point_text(corner.z()) + " ]";
    }
    text += " ] }\n";
  }
  return exported;
}

}  // namespace fiducap
