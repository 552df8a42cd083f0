#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include "capture/recording/csv_reader.hpp"
#include "detection/tag_geometry.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostRows = 4'000'000;
constexpr double kLeastSide_px = 20;  // of a single tag; smaller ones are less accurate
constexpr double kFarOutside = 1;     // image sizes

using Quad = std::array<std::optional<Eigen::Vector2d>, 4>;

/// Index of each column; -1: missing.
struct Columns {
  int image{-1}, camera{-1}, set{-1}, tag{-1}, corner{-1}, point{-1}, u{-1}, v{-1};
  std::array<int, 8> quad{-1, -1, -1, -1, -1, -1, -1, -1};

  [[nodiscard]] bool has_quads() const {
    return tag >= 0 && std::ranges::find(quad, -1) == quad.end();
  }
  [[nodiscard]] bool has_corners() const { return tag >= 0 && corner >= 0 && u >= 0 && v >= 0; }
  [[nodiscard]] bool has_points() const { return point >= 0 && u >= 0 && v >= 0; }
};

int* column_named(Columns& c, std::string_view name) {
  if (name == "image" || name == "frame" || name == "sync_index") return &c.image;
  if (name == "camera" || name == "cam" || name == "cam_id") return &c.camera;
  if (name == "set") return &c.set;
  if (name == "tag" || name == "id") return &c.tag;
  if (name == "corner") return &c.corner;
  if (name == "point" || name == "keypoint_id") return &c.point;
  if (name == "u" || name == "img_loc_x") return &c.u;
  if (name == "v" || name == "img_loc_y") return &c.v;
  constexpr std::array<std::string_view, 8> kQuad{"blx", "bly", "brx", "bry",
                                                  "trx", "try", "tlx", "tly"};
  for (std::size_t i = 0; i < kQuad.size(); ++i)
    if (name == kQuad[i]) return &c.quad[i];
  return nullptr;
}

/// The corners of one image, by tag or by point.
struct SeenImage {
  std::map<int, Quad> tags;
  std::map<int, Eigen::Vector2d> points;
};

class CornerRows final {
 public:
  explicit CornerRows(const CornerFileChoice& choice) : choice_(choice) {}

  Expected<void> read() {
    auto csv = CsvReader::open(choice_.path);
    if (!csv) return tl::unexpected(csv.error());
    if (!csv->next()) return fail(ErrorCode::kInvalid, "is empty", choice_.path);
    const auto names = csv->fields();
    for (std::size_t i = 0; i < names.size(); ++i)
      if (int* column = column_named(columns_, names[i])) *column = static_cast<int>(i);
    const bool tags = columns_.has_quads() || columns_.has_corners();
    if (columns_.image < 0 || (choice_.board.has_tags() ? !tags : !columns_.has_points()))
      return fail(ErrorCode::kInvalid,
                  std::string("needs a first line with column names: ") +
                      (choice_.board.has_tags()
                           ? "image,tag,corner,u,v or image,tag,blx,bly,brx,bry,trx,try,tlx,tly"
                           : "image,point,u,v"),
                  choice_.path);
    while (csv->next()) {
      if (++rows_ > kMostRows)
        return fail(ErrorCode::kInvalid, "has more than 4 million rows", choice_.path);
      if (!take(csv->fields())) csv->count_damaged();
    }
    csv->log_damage();
    return {};
  }

  std::map<std::string, SeenImage> images;
  std::vector<std::string> order;  ///< Of the images.
  std::set<std::string> sets;

 private:
  using Fields = std::span<const std::string_view>;

  [[nodiscard]] std::string_view text(Fields fields, int column) const {
    const auto at = static_cast<std::size_t>(column);
    return column >= 0 && at < fields.size() ? fields[at] : std::string_view();
  }
  template <typename Number>
  [[nodiscard]] std::optional<Number> number(Fields fields, int column) const {
    Number value{};
    if (!parse_number(text(fields, column), value)) return std::nullopt;
    return value;
  }
  [[nodiscard]] std::optional<Eigen::Vector2d> pixel(Fields fields, int u, int v) const {
    const auto x = number<double>(fields, u);
    const auto y = number<double>(fields, v);
    if (!x || !y) return std::nullopt;
    const auto near = [](double at, int size) {
      return at > -kFarOutside * size && at < (1 + kFarOutside) * size;
    };
    if (!near(*x, choice_.width) || !near(*y, choice_.height)) return std::nullopt;
    return Eigen::Vector2d(*x, *y);
  }

  /// @return false when the row is damaged; rows of other sets and cameras are skipped
  bool take(Fields fields) {
    if (columns_.set >= 0) {
      const std::string_view set = text(fields, columns_.set);
      constexpr std::size_t kMostSets = 1000;
      if (sets.size() < kMostSets) sets.emplace(set);
      if (!choice_.set.empty() && set != choice_.set) return true;
    }
    if (columns_.camera >= 0) {
      const auto camera = number<int>(fields, columns_.camera);
      if (!camera) return false;
      if (*camera != choice_.camera) return true;
    }
    const std::string name(text(fields, columns_.image));
    if (name.empty()) return false;
    const auto [image, is_new] = images.try_emplace(name);
    if (is_new) order.push_back(name);
    return choice_.board.has_tags() ? take_tag(fields, image->second)
                                    : take_point(fields, image->second);
  }

  bool take_point(Fields fields, SeenImage& image) const {
    const auto point = number<int>(fields, columns_.point);
    const auto px = pixel(fields, columns_.u, columns_.v);
    if (!point || !px || *point < 0 ||
        static_cast<std::size_t>(*point) >= choice_.board.board.points.size())
      return false;
    return image.points.try_emplace(*point, *px).second;
  }

  bool take_tag(Fields fields, SeenImage& image) const {
    const auto tag = number<int>(fields, columns_.tag);
    if (!tag || *tag < 0) return false;
    if (choice_.board.is_board() && !choice_.board.first_corner_of_tag.contains(*tag)) return false;
    if (columns_.has_corners()) {
      const auto corner = number<int>(fields, columns_.corner);
      const auto px = pixel(fields, columns_.u, columns_.v);
      if (!corner || *corner < 0 || *corner > 3 || !px) return false;
      auto& place = image.tags[*tag][static_cast<std::size_t>(*corner)];
      if (place) return false;
      place = px;
      return true;
    }
    Quad quad;
    for (std::size_t i = 0; i < 4; ++i) {
      quad[i] = pixel(fields, columns_.quad[2 * i], columns_.quad[2 * i + 1]);
      if (!quad[i]) return false;
    }
    return image.tags.try_emplace(*tag, quad).second;
  }

  const CornerFileChoice& choice_;
  Columns columns_;
  std::size_t rows_{0};
};

bool is_whole(const Quad& quad) {
  return std::ranges::all_of(quad, [](const auto& px) { return px.has_value(); });
}

double shortest_side(const Quad& quad) {
  double shortest = (*quad[3] - *quad[0]).norm();
  for (std::size_t i = 0; i < 3; ++i)
    shortest = std::min(shortest, (*quad[i + 1] - *quad[i]).norm());
  return shortest;
}

/// Area of the corners in their order; v points down, so a tag seen from its front has it negative.
double signed_area(const Quad& quad) {
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = *quad[i];
    const Eigen::Vector2d& b = *quad[(i + 1) % 4];
    sum += a.x() * b.y() - a.y() * b.x();
  }
  return sum / 2;
}

class CornerViews final {
 public:
  explicit CornerViews(const BoardDescription& board) : board_(board) {
    if (board.is_board()) data.targets.push_back(board.board);
  }

  void add(const std::string& name, const SeenImage& image) {
    CalibrationView view{name, {}};
    if (board_.is_board())
      add_board(image, view);
    else
      add_tags(image, view);
    if (!view.sightings.empty()) data.views.push_back(std::move(view));
  }

  [[nodiscard]] bool mirrored() const { return 2 * from_behind_ > tags_; }

  CalibrationData data;

 private:
  void add_board(const SeenImage& image, CalibrationView& view) {
    TargetSighting sighting;
    for (const auto& [point, px] : image.points) sighting.points.push_back({point, px, px});
    for (const auto& [tag, quad] : image.tags)
      if (is_whole(quad)) add_corners(quad, board_.first_corner_of_tag.at(tag), sighting);
    constexpr std::size_t kLeastPoints = 6;
    if (sighting.points.size() >= kLeastPoints) view.sightings.push_back(std::move(sighting));
  }

  void add_tags(const SeenImage& image, CalibrationView& view) {
    for (const auto& [tag, quad] : image.tags) {
      if (!is_whole(quad) || shortest_side(quad) < kLeastSide_px) continue;
      TargetSighting sighting;
      sighting.target = target_of(tag);
      add_corners(quad, 0, sighting);
      view.sightings.push_back(std::move(sighting));
    }
  }

  void add_corners(const Quad& quad, int first, TargetSighting& sighting) {
    ++tags_;
    from_behind_ += signed_area(quad) > 0 ? 1 : 0;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d& px = *quad[static_cast<std::size_t>(i)];
      sighting.points.push_back({first + i, px, px});
    }
  }

  int target_of(int tag) {
    const auto [known, is_new] = target_of_tag_.try_emplace(tag, data.targets.size());
    if (is_new) {
      CalibrationTarget made{"tag " + std::to_string(tag), {}, false};
      for (int i = 0; i < 4; ++i) made.points.push_back(tag_corner(i, board_.tag_m));
      data.targets.push_back(std::move(made));
    }
    return static_cast<int>(known->second);
  }

  const BoardDescription& board_;
  std::map<int, std::size_t> target_of_tag_;
  std::size_t tags_{0}, from_behind_{0};
};

}  // namespace

std::optional<std::pair<int, int>> pair_from(std::string_view text) {
  const auto by = text.find('x');
  std::pair<int, int> pair;
  if (by == std::string_view::npos || !parse_number(text.substr(0, by), pair.first) ||
      !parse_number(text.substr(by + 1), pair.second))
    return std::nullopt;
  return pair;
}

Expected<CalibrationData> read_corner_file(const CornerFileChoice& choice) {
  CornerRows rows(choice);
  if (const auto read = rows.read(); !read) return tl::unexpected(read.error());
  if (choice.set.empty() ? rows.sets.size() > 1 : !rows.sets.contains(choice.set))
    return fail(ErrorCode::kInvalid,
                "holds the sets " + comma_list(rows.sets) + ": choose one with --set", choice.path);
  CornerViews views(choice.board);
  views.data.width = choice.width;
  views.data.height = choice.height;
  for (const std::string& name : rows.order) views.add(name, rows.images.at(name));
  if (views.data.views.empty())
    return fail(ErrorCode::kNotFound,
                "holds no corners that can be used (of camera " + std::to_string(choice.camera) +
                    ", on the board as described, sides of 20 px or more)",
                choice.path);
  if (views.mirrored())
    return fail(
        ErrorCode::kInvalid,
        "the corners of most tags run clockwise: the images are mirrored, or the corners are "
        "not in the order bottom left, bottom right, top right, top left. Switch mirroring "
        "off in the camera's driver and record again",
        choice.path);
  return std::move(views.data);
}

}  // namespace fiducap
