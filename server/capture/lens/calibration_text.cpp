#include <algorithm>
#include <array>
#include <cctype>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "base/text.hpp"
#include "capture/lens/calibration_files.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostLines = 10'000;

std::vector<std::string_view> words_of(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n,";
  std::vector<std::string_view> words;
  for (std::size_t at = text.find_first_not_of(kBlank); at != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(kBlank, at), text.size());
    words.push_back(text.substr(at, end - at));
    at = text.find_first_not_of(kBlank, end);
  }
  return words;
}

/// Lines without comments and empty ones.
std::vector<std::string_view> lines_of(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty() && lines.size() < kMostLines) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    const auto words = words_of(line);
    if (!words.empty() && !words.front().starts_with('#')) lines.push_back(line);
  }
  return lines;
}

/// The numbers of a line; empty when it has any other word.
std::vector<double> numbers_of(const std::vector<std::string_view>& words) {
  std::vector<double> numbers(words.size());
  for (std::size_t i = 0; i < words.size(); ++i)
    if (!parse_number(words[i], numbers[i])) return {};
  return numbers;
}

// --- OpenCV's XML ---

class Xml final {
 public:
  explicit Xml(std::string_view text) : rest_(text) {}

  /// The element that begins here with its content. @return false: none, or broken
  bool element(std::string& name, YAML::Node& content, int depth) {
    constexpr int kDeepest = 4;
    if (depth > kDeepest || !skip_to_tag() || rest_.starts_with("</")) return false;
    const std::size_t end = rest_.find('>');
    if (end == std::string_view::npos) return false;
    const std::string_view tag = rest_.substr(1, end - 1);
    name = std::string(tag.substr(0, tag.find_first_of(" \t\r\n/")));
    rest_.remove_prefix(end + 1);
    if (tag.ends_with('/')) return true;
    YAML::Node children(YAML::NodeType::Map);
    const std::string_view before = rest_.substr(0, rest_.find('<'));
    std::string child;
    for (YAML::Node below; element(child, below, depth + 1); below.reset(YAML::Node()))
      children[child] = below;
    content = children.size() > 0 ? children : value_of(before);
    const std::size_t close = rest_.find('>');
    if (!rest_.starts_with("</" + name) || close == std::string_view::npos) return false;
    rest_.remove_prefix(close + 1);
    return true;
  }

 private:
  /// To the next element, past declarations and comments.
  bool skip_to_tag() {
    for (;;) {
      rest_.remove_prefix(std::min(rest_.find('<'), rest_.size()));
      const bool comment = rest_.starts_with("<!--");
      if (!comment && !rest_.starts_with("<?") && !rest_.starts_with("<!")) return !rest_.empty();
      const std::string_view ends = comment ? "-->" : ">";
      const std::size_t end = rest_.find(ends);
      rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + ends.size());
    }
  }

  static YAML::Node value_of(std::string_view text) {
    const auto words = words_of(text);
    YAML::Node value;
    if (words.size() == 1) value = std::string(words.front());
    if (words.size() > 1)
      for (const std::string_view word : words) value.push_back(std::string(word));
    return value;
  }

  std::string_view rest_;
};

std::optional<YAML::Node> node_of_xml(std::string_view text) {
  std::string name;
  YAML::Node content;
  if (!Xml(text).element(name, content, 0) || !content.IsMap()) return YAML::Node();
  return content;
}

// --- ROS' ost.ini ---

/// A heading, and below it the numbers of one line or several.
std::optional<YAML::Node> node_of_ini(const std::vector<std::string_view>& lines) {
  constexpr std::array<std::array<std::string_view, 2>, 4> kHeadings{
      {{"width", "image_width"},
       {"height", "image_height"},
       {"camera matrix", "camera_matrix"},
       {"distortion", "distortion_coefficients"}}};
  YAML::Node node(YAML::NodeType::Map);
  std::string key;
  for (const std::string_view line : lines) {
    const auto words = words_of(line);
    const std::vector<double> numbers = numbers_of(words);
    if (numbers.empty()) {
      const std::string_view heading = line.substr(0, line.find_last_not_of(" \t\r") + 1);
      const auto* known = std::ranges::find(kHeadings, heading, [](const auto& h) { return h[0]; });
      key = known == kHeadings.end() ? "" : std::string((*known)[1]);
    }
    if (key.empty()) continue;
    if (key.starts_with("image")) {
      if (!numbers.empty()) node[key] = numbers.front();
      continue;
    }
    for (const double number : numbers) node[key].push_back(number);
  }
  return node;
}

// --- COLMAP ---

struct ColmapModel {
  std::string_view name;
  bool one_focal;
  const char* lens;
  std::size_t radial;  ///< Coefficients after the centre.
};
constexpr std::array<ColmapModel, 9> kColmap{{{"SIMPLE_PINHOLE", true, "none", 0},
                                              {"PINHOLE", false, "none", 0},
                                              {"SIMPLE_RADIAL", true, "radtan", 1},
                                              {"RADIAL", true, "radtan", 2},
                                              {"OPENCV", false, "radtan", 4},
                                              {"FULL_OPENCV", false, "rational_polynomial", 8},
                                              {"OPENCV_FISHEYE", false, "equidistant", 4},
                                              {"SIMPLE_RADIAL_FISHEYE", true, "equidistant", 1},
                                              {"RADIAL_FISHEYE", true, "equidistant", 2}}};

/// CAMERA_ID MODEL WIDTH HEIGHT PARAMS… @return nullopt: no such line
std::optional<YAML::Node> colmap_camera(std::string_view line) {
  const auto words = words_of(line);
  int id = 0;
  if (words.size() < 7 || !parse_number(words[0], id)) return std::nullopt;
  const std::vector<double> numbers = numbers_of({words.begin() + 2, words.end()});
  if (numbers.empty()) return std::nullopt;
  YAML::Node camera(YAML::NodeType::Map);
  camera["resolution"].push_back(numbers[0]);
  camera["resolution"].push_back(numbers[1]);
  const auto* model = std::ranges::find(kColmap, words[1], &ColmapModel::name);
  if (model == kColmap.end()) {
    camera["camera_model"] = std::string(words[1]);
    camera["intrinsics"] = YAML::Node(YAML::NodeType::Sequence);
    return camera;
  }
  const std::size_t centre = model->one_focal ? 3 : 4;
  if (numbers.size() != centre + 2 + model->radial) return std::nullopt;
  // COLMAP's pixel (0.5, 0.5) is the centre of the upper-left one.
  for (const double number :
       {numbers[2], numbers[centre - 1], numbers[centre] - 0.5, numbers[centre + 1] - 0.5})
    camera["intrinsics"].push_back(number);
  camera["distortion_model"] = model->lens;
  const std::size_t listed = model->radial == 0 ? 0 : std::max<std::size_t>(model->radial, 4);
  for (std::size_t i = 0; i < listed; ++i)
    camera["distortion_coefficients"].push_back(i < model->radial ? numbers[centre + 2 + i] : 0.0);
  return camera;
}

std::optional<YAML::Node> node_of_colmap(const std::vector<std::string_view>& lines) {
  YAML::Node node;
  for (const std::string_view line : lines) {
    const auto camera = colmap_camera(line);
    if (!camera) return std::nullopt;
    node["calibrations"].push_back(*camera);
  }
  return node;
}

// --- DSO ---

/// `RadTan fu fv cu cv k1 k2 r1 r2`, below it width and height. cu and cv below 1 are shares of
/// the image, from the upper left corner of its first pixel.
std::optional<YAML::Node> node_of_dso(const std::vector<std::string_view>& lines) {
  struct Model {
    std::string_view name;
    const char* lens;
  };
  constexpr std::array<Model, 6> kModels{{{"Pinhole", "none"},
                                          {"RadTan", "radtan"},
                                          {"EquiDistant", "equidistant"},
                                          {"KannalaBrandt", "KannalaBrandt"},
                                          {"FOV", "FOV"},
                                          {"ATAN", "FOV"}}};
  const auto words = words_of(lines.front());
  const auto* model = std::ranges::find(kModels, words.front(), &Model::name);
  if (model == kModels.end() || lines.size() < 2) return std::nullopt;
  std::vector<double> lens = numbers_of({words.begin() + 1, words.end()});
  const std::vector<double> size = numbers_of(words_of(lines[1]));
  if (lens.size() < 4 || size.size() != 2) return std::nullopt;
  if (lens[2] < 1 && lens[3] < 1) {
    for (std::size_t i = 0; i < 4; ++i) lens[i] *= size[i % 2];
    lens[2] -= 0.5;
    lens[3] -= 0.5;
  }
  YAML::Node node(YAML::NodeType::Map);
  node["resolution"] = size;
  node["intrinsics"] = std::vector<double>(lens.begin(), lens.begin() + 4);
  node["distortion_model"] = model->lens;
  if (model->lens != std::string_view("none"))
    node["distortion_coefficients"] = std::vector<double>(lens.begin() + 4, lens.end());
  return node;
}

}  // namespace

std::optional<YAML::Node> calibration_node(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (begin == std::string_view::npos) return std::nullopt;
  if (text.substr(begin).starts_with("<?xml") || text.substr(begin).starts_with("<opencv_storage"))
    return node_of_xml(text);
  const auto lines = lines_of(text);
  if (lines.empty()) return std::nullopt;
  if (std::ranges::any_of(lines, [](std::string_view line) { return line.starts_with("[image]"); }))
    return node_of_ini(lines);
  if (auto node = node_of_dso(lines)) return node;
  return node_of_colmap(lines);
}

}  // namespace fiducap
