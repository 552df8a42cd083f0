#include "detection/no_tag.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "detection/april_grid.hpp"
#include "detection/candidate_search.hpp"
#include "detection/corner_sigma.hpp"
#include "detection/image_measures.hpp"
#include "detection/observe.hpp"
#include "detection/other_families.hpp"
#include "detection/tag_detector.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostImages = 3;
constexpr int kWhitest = 255;
constexpr double kLowContrast = 60;  // grays; such images are stretched before they are searched
constexpr double kMostGain = 20;
constexpr double kDark = 60;     // grays, of the brightest pixels
constexpr double kFlat = 25;     // grays between both
constexpr double kBright = 200;  // … of the darkest ones
constexpr int kSmall_px = 800 * 600;
constexpr int kLarge_px = 2000 * 1500;
constexpr double kBlurredCells = 1.0;  // blur across a side in which bits cannot be read
constexpr double kSharp_px = 2;        // ImageBlur
constexpr double kReadable_px = 2;     // of a cell
constexpr double kSmallCell_px = 2.5;  // at which a search begins to miss tags
constexpr double kSureMargin = 10;     // of families that are not configured
constexpr double kLeastOfGrid_px = 15;
constexpr std::size_t kSureIds = 3;  // ids of a weak family in one image that are no chance

enum class Change { kNone, kMirrored, kNegative, kMirroredNegative, kEnlarged };
constexpr std::array kChanges{Change::kNone, Change::kMirrored, Change::kNegative,
                              Change::kMirroredNegative, Change::kEnlarged};

bool is_mirrored(Change c) { return c == Change::kMirrored || c == Change::kMirroredNegative; }
bool is_negative(Change c) { return c == Change::kNegative || c == Change::kMirroredNegative; }

cv::Mat mat_of(const GrayImage& image) {
  // OpenCV takes a non-const pointer but only reads.
  return {image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.pixels.data())};
}

GrayImage changed(const GrayImage& image, Change change) {
  GrayImage out = image;
  if (is_negative(change))
    for (std::uint8_t& gray : out.pixels) gray = static_cast<std::uint8_t>(kWhitest - gray);
  if (is_mirrored(change))
    for (auto row = out.pixels.begin(); row != out.pixels.end(); row += out.width)
      std::reverse(row, row + out.width);
  if (change == Change::kEnlarged) {
    out.resize(2 * image.width, 2 * image.height);
    cv::Mat large = mat_of(out);
    cv::resize(mat_of(image), large, large.size(), 0, 0, cv::INTER_CUBIC);
  }
  return out;
}

/// Steps between searched pixels: every pixel once, else as the size allows.
double step_for(const GrayImage& image, Change change) {
  const int pixels = image.width * image.height;
  const int smaller = pixels <= kSmall_px ? 1 : pixels <= kLarge_px ? 2 : 4;
  return change == Change::kNone ? std::max(1, smaller / 2) : smaller;
}

/// The tags of one family in several images.
struct Found {
  const TagFamilyFacts* family{};
  std::vector<std::vector<TagSighting>> images;

  [[nodiscard]] std::size_t most() const {
    return std::ranges::max(images, {}, &std::vector<TagSighting>::size).size();
  }
  [[nodiscard]] std::size_t all() const {
    std::size_t sum = 0;
    for (const auto& tags : images) sum += tags.size();
    return sum;
  }
  /// By chance a square is a tag of a weak family, but not again in another image.
  [[nodiscard]] bool is_sure_of_weak() const {
    std::set<int> before;
    for (const auto& tags : images) {
      std::set<int> ids;
      for (const TagSighting& tag : tags)
        if (tag.decision_margin >= family->min_margin) ids.insert(tag.tag_id);
      if (ids.size() >= kSureIds) return true;
      for (const int id : ids)
        if (!before.insert(id).second) return true;
    }
    return false;
  }
  template <typename Number>
  [[nodiscard]] double median(const Number& number) const {
    std::vector<double> all;
    for (const auto& tags : images)
      for (const TagSighting& tag : tags) all.push_back(number(tag));
    return quantile(std::move(all), 0.5);
  }
  [[nodiscard]] double width_px() const {
    return median([](const TagSighting& tag) { return outline_of(tag.corners_px).width_px; });
  }
  [[nodiscard]] double margin() const {
    return median([](const TagSighting& tag) { return tag.decision_margin; });
  }
  /// `6 tags are found`
  [[nodiscard]] std::string text() const {
    return std::to_string(most()) + (most() == 1 ? " tag is found" : " tags are found");
  }
};

bool is_of_april_grid(const Found& found) { return find_tag_family(found.family->name) == nullptr; }

/// Looks at a few images again.
class SecondLook final {
 public:
  SecondLook(std::span<const SharedImage> images, const TagSetConfig& tags,
             std::stop_token stop = {})
      : wanted_(find_tag_family(tags.family)), stop_(std::move(stop)) {
    for (const SharedImage& image : images)
      if (image != nullptr && std::min(image->width, image->height) > 0) images_.push_back(image);
    images_ = thinned(images_, kMostImages);
  }

  [[nodiscard]] bool is_empty() const { return images_.empty(); }
  [[nodiscard]] const std::vector<SharedImage>& images() const { return images_; }
  [[nodiscard]] const TagFamilyFacts* wanted() const { return wanted_; }

  /// All families that are read in the changed images, false ones as well.
  [[nodiscard]] std::vector<Found> search(Change change) {
    std::vector<Found> all;
    for (std::size_t i = 0; i < images_.size() && !stop_.stop_requested(); ++i) {
      if (change == Change::kEnlarged && images_[i]->pixels.size() > std::size_t{kLarge_px} / 2)
        continue;
      const GrayImage image = changed(stretched(*images_[i]), change);
      sightings_.clear();
      const int contrast = contrast_above(pixel_noise(image).value_or(0), {});
      detector_.detect(image, {step_for(image, change), contrast}, sightings_);
      for (const FamilySighting& seen : sightings_) add(seen, i, change, all);
    }
    return all;
  }

  /// Of those that are no chance the one with the most tags, of equal ones the configured one.
  /// @param weak  only weak families; else all others, and the configured one
  [[nodiscard]] std::optional<Found> best(std::vector<Found> all, bool weak = false) const {
    std::erase_if(all, [&](const Found& found) { return !is_sure(found, weak); });
    std::ranges::stable_sort(all, [&](const Found& a, const Found& b) {
      return std::pair(b.all(), b.family == wanted_) < std::pair(a.all(), a.family == wanted_);
    });
    return all.empty() ? std::nullopt : std::optional(std::move(all.front()));
  }

  [[nodiscard]] Found april_grid() {
    AprilGridSearch search;
    static const TagFamily kFamily = std::move(*TagFamily::named(kAprilGridFamily));
    Found found{&kFamily.facts(), {}};
    for (const SharedImage& image : images_) found.images.push_back(search.find(*image));
    return found;
  }

  /// Gain on the contrast of an image before it is searched.
  [[nodiscard]] static double gain_of(const GrayImage& image) {
    const ImageMeasures light = measure(image);
    const double contrast = light.white - light.black;
    // Of pure noise 98 % of the pixels are within this many sigmas.
    constexpr double kNoise_sigma = 5;
    if (contrast >= kLowContrast || contrast < kNoise_sigma * pixel_noise(image).value_or(0))
      return 1;
    return std::min(kMostGain, kWhitest / std::max(contrast, 1.0));
  }

 private:
  [[nodiscard]] bool is_sure(const Found& found, bool weak) const {
    const bool is_wanted = found.family == wanted_;
    if (is_wanted ? weak : weak != found.family->is_weak) return false;
    if (found.family->is_weak) return found.is_sure_of_weak();
    // A small tag36h11 with a border that looks too wide is no AprilGrid.
    if (is_of_april_grid(found) && found.width_px() < kLeastOfGrid_px) return false;
    return is_wanted || (found.margin() >= kSureMargin && (found.all() > 1 || images_.size() == 1));
  }

  [[nodiscard]] static GrayImage stretched(const GrayImage& image) {
    GrayImage out = image;
    const double gain = gain_of(image);
    if (gain == 1) return out;
    const double black = measure(image).black;
    for (std::uint8_t& gray : out.pixels)
      gray = static_cast<std::uint8_t>(std::clamp(gain * (gray - black), 0.0, double(kWhitest)));
    return out;
  }

  void add(const FamilySighting& seen, std::size_t image, Change change,
           std::vector<Found>& all) const {
    auto found = std::ranges::find(all, seen.family, &Found::family);
    if (found == all.end()) {
      all.push_back({seen.family, std::vector<std::vector<TagSighting>>(images_.size())});
      found = all.end() - 1;
    }
    TagSighting tag = seen.tag;
    if (change == Change::kEnlarged)
      for (Eigen::Vector2d& px : tag.corners_px) px *= 0.5;
    found->images[image].push_back(tag);
  }

  const TagFamilyFacts* wanted_;
  std::stop_token stop_;
  std::vector<SharedImage> images_;
  AnyFamilyDetector detector_;
  std::vector<FamilySighting> sightings_;
};

/// Of another family than the configured one.
std::string print_text(const Found& found, const std::string& wanted) {
  const std::string name(found.family->name);
  if (is_of_april_grid(found))
    return "the tags are those of " + name + ", with a border of two cells (" + found.text() +
           "): it serves for `fiducap calibrate camera` only. For poses print a sheet of `fiducap "
           "tags sheet`";
  const std::string turned = half_turned_family(name);
  return "the tags are " + name + ", not " + wanted + " (" + found.text() +
         "): set the family (tags.family; --tag-family of `fiducap import`)" +
         (turned.empty() ? "" : ", or " + turned + " if OpenCV has printed them");
}

std::string change_text(Change change, const Found& found) {
  switch (change) {
    case Change::kNone:
      break;
    case Change::kMirrored:
      return "the images are mirrored: " + found.text() +
             " when they are flipped. Switch the mirror off in the driver, or remove the mirror";
    case Change::kNegative:
      return "the images are negatives, or the tags are printed white on black: " + found.text() +
             " when black and white are exchanged. Switch the inversion off, or print black on "
             "white";
    case Change::kMirroredNegative:
      return "the images are mirrored, and black and white are exchanged: " + found.text() +
             " when both are undone. Switch mirror and inversion off in the driver";
    case Change::kEnlarged:
      return "the tags are too small in the images: " + found.text() + " when they are enlarged, " +
             fixed(found.width_px(), 0) + " px wide, needed are " +
             fixed(kReadable_px * found.family->edge_cells, 0) +
             " px. Go nearer, print larger tags, or use more pixels";
  }
  return {};
}

/// What is wrong with the light; nullopt: nothing.
std::optional<std::string> light_text(const ImageMeasures& light) {
  if (light.white < kDark)
    return "the images are dark, their brightest pixels have gray " + fixed(light.white, 0) +
           " of 255. Is the lens covered? More light, or a longer exposure";
  if (light.black > kBright)
    return "the images are too bright, their darkest pixels have gray " + fixed(light.black, 0) +
           " of 255. Less light, or a shorter exposure";
  return std::nullopt;
}

/// Tags of the family that is configured, in images as they are.
std::string found_text(const Found& found, const std::vector<SharedImage>& images,
                       const TagSetConfig& tags, const DetectorConfig& config) {
  const bool are_ignored = std::ranges::all_of(found.images, [&](const auto& seen) {
    return std::ranges::all_of(seen, [&](const TagSighting& tag) {
      return std::ranges::count(tags.ignore, tag.tag_id) > 0;
    });
  });
  if (are_ignored) return found.text() + ", but tags.ignore lists all of them";
  const ImageMeasures light = measure(*images.front());
  const double gain = SecondLook::gain_of(*images.front());
  const double margin = found.margin() / gain;
  const double least = std::max(config.min_decision_margin, found.family->min_margin);
  if (margin < least)
    return light_text(light).value_or(
               "the images have little contrast: is the lens foggy, or is it against the light?") +
           " (" + found.text() + " with a decision margin of " + fixed(margin, 1) +
           ", needed are " + fixed(least, 0) + ", detector.min_decision_margin)";
  const bool are_small =
      found.width_px() < kSmallCell_px * config.decimate * found.family->edge_cells;
  return std::string(are_small ? "the tags are small: " : "") + found.text() + ", " +
         fixed(found.width_px(), 0) + " px wide, when every pixel is searched. " +
         (are_small ? "Go nearer, print larger tags, or set detector.decimate: 1"
                    : "Set detector.decimate: 1");
}

/// Blur of the sides of a dark square, px.
ImageBlur blur_of_square(const GrayImage& image, const TagCandidate& square, int cells) {
  TagSighting side;
  side.corners_px = square.corners_px;
  side.sides = measure_sides(image, square.corners_px, cells);
  side.sharpness = least_sharpness(side.sides);
  return blur_of(std::array{side});
}

/// Dark squares that are read as no tag.
struct UnreadSquares {
  std::size_t most{0};  ///< In an image, those that are large enough.
  double blur_px{0};    ///< The largest that hides the bits; 0: none does.
  double small_px{0};   ///< Width of the widest of the others; 0: there are none.
};

UnreadSquares squares_in(const std::vector<SharedImage>& images, const TagSetConfig& tags,
                         const DetectorConfig& config, int cells) {
  CandidateSearch search(tags, config);
  std::vector<TagCandidate> squares;
  UnreadSquares out;
  for (const SharedImage& image : images) {
    search.search(*image, {}, squares);
    std::size_t here = 0;
    for (const TagCandidate& square : squares) {
      const double width_px = outline_of(square.corners_px).width_px;
      if (square.why == TagCandidate::Why::kTooSmall)
        out.small_px = std::max(out.small_px, width_px);
      if (square.why != TagCandidate::Why::kUnread) continue;
      ++here;
      const ImageBlur blur = blur_of_square(*image, square, cells);
      const double across_px = std::hypot(blur.focus_px, blur.motion_px);
      if (blur.tags > 0 && across_px > std::max(2 * kSharp_px, kBlurredCells * width_px / cells))
        out.blur_px = std::max(out.blur_px, across_px);
    }
    out.most = std::max(out.most, here);
  }
  return out;
}

/// What light, blur and dark squares show.
std::string looks_text(const std::vector<SharedImage>& images, const TagSetConfig& tags,
                       const DetectorConfig& config) {
  const ImageMeasures light = measure(*images[images.size() / 2]);
  if (auto text = light_text(light)) return *text;
  const int cells = find_tag_family(tags.family)->edge_cells;
  UnreadSquares squares = squares_in(images, tags, config, cells);
  constexpr double kSoft = 0.4;    // ImageMeasures::steepest of an image without a sharp edge
  constexpr double kMoved = 0.25;  // … of one without a sharp edge across some direction
  const bool has_moved = squares.small_px > 0 && light.least_steep < kMoved;
  const bool is_blurred = light.steepest < kSoft || has_moved;
  if (squares.blur_px == 0 && light.least_steep > 0 && is_blurred)
    squares.blur_px = kSharp_px / light.least_steep;
  if (squares.blur_px > 0)
    return "the images are blurred over " + fixed(squares.blur_px, 0) + " px (" +
           fixed(kSharp_px, 0) +
           " are sharp). Focus the lens, move slower, or expose shorter in more light";
  if (squares.most > 0)
    return std::to_string(squares.most) +
           (squares.most == 1 ? " dark square is" : " dark squares are") +
           " seen, with the bits of no family: are the prints whole, flat and with a white margin?";
  if (squares.small_px > 0)
    return "the dark squares in the images are too small for tags: up to " +
           fixed(squares.small_px, 0) + " px wide, needed are " + fixed(kReadable_px * cells, 0) +
           " px. Go nearer, print larger tags, or use more pixels";
  if (light.white - light.black < kFlat)
    return "the images have little contrast, their pixels have gray " + fixed(light.black, 0) +
           " to " + fixed(light.white, 0) + ". Is the lens covered, foggy or against the light?";
  return "nothing in them looks like a tag (a dark square on white). Show tags to the camera";
}

}  // namespace

std::string why_no_tag(std::span<const SharedImage> images, const TagSetConfig& tags,
                       const DetectorConfig& config, std::stop_token stop) {
  SecondLook look(images, tags, stop);
  if (look.is_empty()) return {};
  std::optional<Found> weak;
  for (const Change change : kChanges) {
    if (stop.stop_requested()) return {};
    const auto all = look.search(change);
    const auto found = look.best(all);
    const bool is_wanted = found && found->family == look.wanted();
    const std::string text = found ? change_text(change, *found) : "";
    if (is_wanted) return text.empty() ? found_text(*found, look.images(), tags, config) : text;
    if (found) {
      const std::string print = print_text(*found, tags.family);
      return text.empty() ? print : text + ". And " + print;
    }
    if (change != Change::kNone) continue;
    weak = look.best(all, true);
    if (const auto grid = look.best({look.april_grid()})) return print_text(*grid, tags.family);
  }
  return weak ? print_text(*weak, tags.family) : looks_text(look.images(), tags, config);
}

std::string other_family_in(std::span<const SharedImage> images, const TagSetConfig& tags) {
  SecondLook look(images, tags);
  if (look.is_empty()) return {};
  const auto found = look.best(look.search(Change::kNone));
  if (!found || found->family == look.wanted()) return {};
  return print_text(*found, tags.family);
}

}  // namespace fiducap
