#include "tools/calibrate/corner_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include "capture/recording/csv_reader.hpp"
#include "detection/corner_projection.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostRows = 4'000'000;
constexpr double kLeastSide_px = 20;  // of a tag by itself; smaller ones are worse than others
constexpr double kFarOutside = 1;     // image sizes

using Quad = std::array<std::optional<Eigen::Vector2d>, 4>;

/// Where each column is; -1: not there.
struct Columns {
  int image{-1}, camera{-1}, set{-1}, tag{-1}, corner{-1}, point{-1}, u{-1}, v{-1};
  std::array<int, 8> quad{-1, -1, -1, -1, -1, -1, -1, -1};

  [[nodiscard]] bool has_quads() const {
    return tag >= 0 && std::find(quad.begin(), quad.end(), -1) == quad.end();
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

Columns read_columns(std::span<const std::string_view> names) {
  Columns columns;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (int* column = column_named(columns, names[i])) *column = static_cast<int>(i);
  return columns;
}

/// What was seen in one image: corners by tag, or by point.
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
    columns_ = read_columns(csv->fields());
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

  [[nodiscard]] const std::map<std::string, SeenImage>& images() const { return images_; }
  [[nodiscard]] const std::set<std::string>& sets() const { return sets_; }
  [[nodiscard]] const std::vector<std::string>& order() const { return order_; }

 private:
  using Fields = std::span<const std::string_view>;

  [[nodiscard]] std::string_view text(Fields fields, int column) const {
    const auto at = static_cast<std::size_t>(column);
    return column >= 0 && at < fields.size() ? fields[at] : std::string_view();
  }
  template <typename Number>
  [[nodiscard]] std::optional<Number> number(Fields fields, int column) const {
    Number value{};
    if (!parse(text(fields, column), value)) return std::nullopt;
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

  /// @return false when the row is damaged; rows of others are skipped.
  bool take(Fields fields) {
    if (columns_.set >= 0) {
      const std::string_view set = text(fields, columns_.set);
      constexpr std::size_t kMostSets = 1000;
      if (sets_.size() < kMostSets) sets_.emplace(set);
      if (!choice_.set.empty() && set != choice_.set) return true;
    }
    if (columns_.camera >= 0) {
      const auto camera = number<int>(fields, columns_.camera);
      if (!camera) return false;
      if (*camera != choice_.camera) return true;
    }
    const std::string name(text(fields, columns_.image));
    if (name.empty()) return false;
    const auto [image, is_new] = images_.try_emplace(name);
    if (is_new) order_.push_back(name);
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
  std::map<std::string, SeenImage> images_;
  std::vector<std::string> order_;
  std::set<std::string> sets_;
};

bool is_whole(const Quad& quad) {
  return std::all_of(quad.begin(), quad.end(), [](const auto& px) { return px.has_value(); });
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
    for (const auto& [tag, quad] : image.tags) {
      if (!is_whole(quad)) continue;
      look_at(quad);
      const int first = board_.first_corner_of_tag.at(tag);
      for (int i = 0; i < 4; ++i) {
        const Eigen::Vector2d& px = *quad[static_cast<std::size_t>(i)];
        sighting.points.push_back({first + i, px, px});
      }
    }
    constexpr std::size_t kLeastPoints = 6;
    if (sighting.points.size() >= kLeastPoints) view.sightings.push_back(std::move(sighting));
  }

  void add_tags(const SeenImage& image, CalibrationView& view) {
    for (const auto& [tag, quad] : image.tags) {
      if (!is_whole(quad) || shortest_side(quad) < kLeastSide_px) continue;
      look_at(quad);
      TargetSighting sighting;
      sighting.target = target_of(tag);
      for (int i = 0; i < 4; ++i) {
        const Eigen::Vector2d& px = *quad[static_cast<std::size_t>(i)];
        sighting.points.push_back({i, px, px});
      }
      view.sightings.push_back(std::move(sighting));
    }
  }

  void look_at(const Quad& quad) {
    ++tags_;
    from_behind_ += signed_area(quad) > 0 ? 1 : 0;
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
  std::size_t tags_{0};
  std::size_t from_behind_{0};
};

std::string listed_sets(const std::set<std::string>& sets) {
  std::string out;
  for (const std::string& name : sets) out += (out.empty() ? "" : ", ") + name;
  return out;
}

}  // namespace

Expected<CalibrationData> read_corner_file(const CornerFileChoice& choice) {
  CornerRows rows(choice);
  if (const auto read = rows.read(); !read) return tl::unexpected(read.error());
  const bool set_is_there = rows.sets().contains(choice.set);
  if (choice.set.empty() ? rows.sets().size() > 1 : !set_is_there)
    return fail(ErrorCode::kInvalid,
                "holds the sets " + listed_sets(rows.sets()) + ": choose one with --set",
                choice.path);
  CornerViews views(choice.board);
  views.data.width = choice.width;
  views.data.height = choice.height;
  for (const std::string& name : rows.order()) views.add(name, rows.images().at(name));
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
