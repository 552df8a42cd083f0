// TagSLAM's tagslam.yaml and poses.yaml. X_world_tag = pose of the body × pose of the tag on it;
// rotations are axis × angle in radians. Noises are 1-sigma of rotation and shift in the axes of
// the posed object (GTSAM perturbs on the right).
#include <algorithm>
#include <array>
#include <limits>
#include <numbers>
#include <optional>

#include "base/pose.hpp"
#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/yaml_place.hpp"

namespace fiducap {

namespace {

using Eigen::Vector3d;

constexpr int kMostTagsOfABoard = 100'000;
constexpr double kLargestNoise = 1e6;
constexpr double kSmallestNoise = 1e-6;  // GTSAM needs one that is not zero

/// TagSLAM names a family by the side of its code.
struct Bits {
  int bits;
  const char* family;
};
constexpr std::array kBits{Bits{4, "tag16h5"}, Bits{5, "tag25h9"}, Bits{6, "tag36h11"}};

/// A pose with its covariance: position, then attitude, both along the axes it is given in.
struct SurePose {
  Pose X;
  Matrix6d covariance{Matrix6d::Zero()};
};

/// Collected from all bodies.
struct TagslamReading {
  ForeignTags tags{};
  std::string family{};
  std::vector<std::string> remarks{};
  bool has_root_information{false};
};

Vector3d noise_of(const YamlPlace& place) {
  const Vector3d sigma = place.xyz();
  if (sigma.minCoeff() < 0 || sigma.maxCoeff() > kLargestNoise)
    place.refuse("must be between 0 and 1000000");
  return sigma;
}

Matrix6d turned(const Eigen::Matrix3d& R, const Vector3d& position_sigma,
                const Vector3d& rotation_sigma) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.topLeftCorner<3, 3>() = R * position_sigma.cwiseAbs2().asDiagonal() * R.transpose();
  covariance.bottomRightCorner<3, 3>() =
      R * rotation_sigma.cwiseAbs2().asDiagonal() * R.transpose();
  return covariance;
}

SurePose tagslam_pose(const YamlPlace& place, TagslamReading& reading) {
  place.only({"position", "rotation", "position_noise", "rotation_noise", "R"});
  const Vector3d rotation = place.at("rotation").xyz();
  if (rotation.norm() > 2 * std::numbers::pi)
    place.at("rotation")
        .refuse("is " + shortest(rotation.norm()) +
                " long: must be axis x angle in radians, at most 2 pi; are these degrees?");
  SurePose pose{.X = {exp_so3(rotation), place.at("position").xyz()}};
  if (place.has("R")) reading.has_root_information = true;
  if (!place.has("position_noise") && !place.has("rotation_noise")) return pose;
  pose.covariance = turned(pose.X.rotation(), noise_of(place.at("position_noise")),
                           noise_of(place.at("rotation_noise")));
  return pose;
}

/// A rotation of the body by δ shifts its point p by δ × p.
SurePose operator*(const SurePose& X_WB, const SurePose& X_BT) {
  const Eigen::Matrix3d R = X_WB.X.rotation();
  Matrix6d lever = Matrix6d::Identity();
  lever.topRightCorner<3, 3>() = -skew(X_WB.X.q * X_BT.X.p);
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = R;
  return {X_WB.X * X_BT.X,
          lever * X_WB.covariance * lever.transpose() + turn * X_BT.covariance * turn.transpose()};
}

void take_family(int bits, const YamlPlace& place, TagslamReading& reading) {
  const auto* found = std::ranges::find(kBits, bits, &Bits::bits);
  if (found == kBits.end())
    place.refuse("bits = " + std::to_string(bits) + ": must be 4, 5 or 6 (side of the code)");
  if (!reading.family.empty() && reading.family != found->family)
    place.refuse("is of the family " + std::string(found->family) + ", tags before it of " +
                 reading.family + "; a map has one family");
  reading.family = found->family;
}

void add_on_body(int id, double edge_m, const SurePose& X_WB, const SurePose& X_BT,
                 const YamlPlace& place, TagslamReading& reading) {
  const SurePose X_WT = X_WB * X_BT;
  KnownTag tag;
  tag.tag_id = id;
  tag.edge_m = edge_m;
  tag.X_WT = X_WT.X;
  tag.covariance = 0.5 * (X_WT.covariance + X_WT.covariance.transpose());
  reading.tags.add(tag, place);
}

/// @param X_WB  nullopt: not known
void read_listed_tags(const YamlPlace& body, const std::optional<SurePose>& X_WB,
                      TagslamReading& reading) {
  if (!body.has("tags") || body.at("tags").is_empty()) return;
  std::vector<int> without_pose;
  for (const YamlPlace& place : body.at("tags").entries()) {
    place.only({"id", "bits", "size", "pose"});
    const int id = place.at("id").integer();
    if (!X_WB || !place.has("pose")) {
      without_pose.push_back(id);
      continue;
    }
    const double edge_m = place.number_or("size", body.number_or("default_tag_size", 0));
    if (edge_m <= 0) place.refuse("size: is missing, and so is default_tag_size of the body");
    if (place.has("bits")) take_family(place.at("bits").integer(), place, reading);
    add_on_body(id, edge_m, *X_WB, tagslam_pose(place.at("pose"), reading), place, reading);
  }
  if (without_pose.empty()) return;
  reading.remarks.push_back(tags_text(without_pose) + " of " + body.path() + " left out: " +
                            (X_WB ? "no pose is given" : "where the body is, is not known"));
}

/// Columns run along x, rows along y (down it, every other tag left out, on a staggered board).
/// As TagSLAM's code, not its page, this takes the inverse of the board's pose.
void read_board(const YamlPlace& board, bool staggered, const SurePose& X_WB,
                TagslamReading& reading) {
  board.only({"tag_start_id", "tag_size", "tag_spacing", "tag_rows", "tag_columns", "tag_bits",
              "tag_rotation_noise", "tag_position_noise", "pose"});
  const int rows = board.at("tag_rows").integer();
  const int columns = board.at("tag_columns").integer();
  if (rows < 1 || columns < 1 || rows > kMostTagsOfABoard / columns)
    board.refuse("tag_rows x tag_columns must be 1 to 100000 tags");
  const double edge_m = board.at("tag_size").number();
  const double step_m = edge_m * (1 + board.at("tag_spacing").number());
  if (board.has("tag_bits")) take_family(board.at("tag_bits").integer(), board, reading);
  SurePose X_board_body;
  if (board.has("pose")) {
    X_board_body = tagslam_pose(board.at("pose"), reading);
    reading.remarks.push_back(board.path() +
                              ".pose is taken as TagSLAM does, as that of the body on the board");
  }
  const Pose X_body_board = X_board_body.X.inverse();
  const Vector3d position_sigma = Vector3d::Constant(board.number_or("tag_position_noise", 0));
  const Vector3d rotation_sigma = Vector3d::Constant(board.number_or("tag_rotation_noise", 0));
  int id = board.at("tag_start_id").integer();
  if (id < 0 || id > std::numeric_limits<int>::max() - kMostTagsOfABoard)
    board.refuse("tag_start_id = " + std::to_string(id) + ": must be >= 0");
  for (int row = 0; row < rows; ++row) {
    for (int column = staggered ? row % 2 : 0; column < columns; column += staggered ? 2 : 1) {
      const Vector3d centre(column * step_m, (staggered ? -row : row) * step_m, 0);
      SurePose X_BT{.X = X_body_board * Pose{Eigen::Quaterniond::Identity(), centre}};
      X_BT.covariance = turned(X_BT.X.rotation(), position_sigma, rotation_sigma);
      add_on_body(id++, edge_m, X_WB, X_BT, board, reading);
    }
  }
}

void read_body(const YamlPlace& body, TagslamReading& reading) {
  if (!body.is_map())
    body.refuse("must be a map: the keys of a body are one level deeper than its name");
  body.only({"type",
             "is_static",
             "default_tag_size",
             "max_hamming_distance",
             "pose",
             "tags",
             "board",
             "staggered_board",
             "ignore_tags",
             "override_tag_position_noise",
             "override_tag_rotation_noise",
             "T_body_odom",
             "odom_frame_id",
             "odom_topic",
             "odom_translation_noise",
             "odom_rotation_noise",
             "publish_covariance",
             "odom_acceleration",
             "odom_angular_acceleration",
             "odom_acceleration_noise_min",
             "odom_acceleration_noise_max",
             "odom_angular_acceleration_noise_min",
             "odom_angular_acceleration_noise_max",
             "fake_odom_translation_noise",
             "fake_odom_rotation_noise"});
  const std::string type = body.at("type").text();
  if (type != "simple" && type != "camera_rig" && type != "board" && type != "staggered_board")
    body.at("type").refuse("is '" + type + "': must be simple, board or staggered_board");
  const bool is_static = body.at("is_static").flag();
  if (!is_static && body.has("pose")) body.refuse("has a pose, but moves (is_static: false)");
  std::optional<SurePose> X_WB;
  if (is_static && body.has("pose")) X_WB = tagslam_pose(body.at("pose"), reading);
  if (type == "simple" || type == "camera_rig") return read_listed_tags(body, X_WB, reading);
  if (X_WB) return read_board(body.at(type), type == "staggered_board", *X_WB, reading);
  reading.remarks.push_back("the board " + body.path() +
                            " left out: where the body is, is not known");
}

ImportedMap read_tagslam(const YamlPlace& top) {
  TagslamReading reading;
  top.remark_others({"bodies", "tagslam_parameters", "body_defaults", "default_body"},
                    reading.remarks);
  for (const YamlPlace& entry : top.at("bodies").entries())
    for (const auto& [name, body] : entry.members()) read_body(body, reading);
  if (reading.has_root_information)
    reading.remarks.push_back("not read: R of the poses (root of their information)");
  return reading.tags.take(reading.family, std::move(reading.remarks));
}

std::string tagslam_xyz(const char* name, const Vector3d& v, const std::string& indent) {
  return indent + name + ": {" + yaml_fields({"x", "y", "z"}, {v.x(), v.y(), v.z()}) + "}\n";
}

/// @param sigmas  of position, then attitude, along the axes of what is posed
std::string tagslam_pose_lines(const Pose& pose, const Vector6d& sigmas,
                               const std::string& indent) {
  return tagslam_xyz("position", pose.p, indent) +
         tagslam_xyz("rotation", log_so3(pose.q), indent) +
         tagslam_xyz("position_noise", sigmas.head<3>(), indent) +
         tagslam_xyz("rotation_noise", sigmas.tail<3>(), indent);
}

Vector6d own_sigmas(const KnownTag& tag) {
  const Eigen::Matrix3d R_TW = tag.X_WT.rotation().transpose();
  const auto variances = [&](const Eigen::Matrix3d& block) {
    return Vector3d((R_TW * block * R_TW.transpose()).diagonal());
  };
  Vector6d sigmas;
  sigmas << variances(tag.covariance.topLeftCorner<3, 3>()),
      variances(tag.covariance.bottomRightCorner<3, 3>());
  return sigmas.cwiseMax(0.0).cwiseSqrt().cwiseMax(kSmallestNoise).cwiseMin(kLargestNoise);
}

int bits_of(const std::string& family) {
  for (const Bits& one : kBits)
    if (family == one.family) return one.bits;
  return 0;
}

}  // namespace

Expected<ImportedMap> map_from_tagslam_yaml(const std::string& text,
                                            const MapImportOptions& options,
                                            const std::string& context) {
  return read_foreign_yaml(text, options, context, read_tagslam);
}

ExportedMap map_to_tagslam_yaml(const TagMap& map) {
  ExportedMap exported;
  const auto tags = tags_to_export(map, {.sigmas = true}, exported.remarks);
  const int bits = bits_of(map.family);
  if (bits == 0)
    exported.remarks.push_back("TagSLAM has no name for the family " + map.family +
                               "; configure its detector for it");
  if (std::ranges::any_of(tags,
                          [](const MapTag* entry) { return entry->tag.covariance.isZero(0); })) {
    exported.remarks.push_back("TagSLAM needs noises: exact tags have 0.001 mm and 0.001 mrad");
  }
  std::string& text = exported.text;
  text = "# Tags of the family " + map.family +
         ". Metres and radians; add the bodies that move and carry the cameras.\n"
         "tagslam_parameters:\n  optimizer_mode: slow\n"
         "body_defaults:\n  position_noise: 0.05\n  rotation_noise: 0.01\n"
         "bodies:\n  - workspace:\n      type: simple\n      is_static: true\n";
  if (!tags.empty())
    text += "      default_tag_size: " + to_point_text(tags.front()->tag.edge_m) + "\n";
  text += "      pose:\n" + tagslam_pose_lines({}, Vector6d::Constant(kSmallestNoise), "        ");
  text += tags.empty() ? "      tags: []\n" : "      tags:\n";
  for (const MapTag* entry : tags) {
    text += "        - id: " + std::to_string(entry->tag.tag_id) + "\n";
    if (bits != 0) text += "          bits: " + std::to_string(bits) + "\n";
    text += "          size: " + to_point_text(entry->tag.edge_m) + "\n          pose:\n" +
            tagslam_pose_lines(entry->tag.X_WT, own_sigmas(entry->tag), "            ");
  }
  return exported;
}

}  // namespace fiducap
