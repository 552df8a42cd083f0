#include "streaming/web/view_codec.hpp"

#include <array>
#include <charconv>
#include <optional>

#include "base/numeric.hpp"
#include "streaming/web/codec.hpp"

namespace fiducap::web {

namespace {

std::string_view name_of(ViewAccess::Kind kind) {
  static constexpr std::array<std::string_view, 3> kNames{"granted", "proof", "denied"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view name_of(ViewOutline::Kind kind) {
  static constexpr std::array<std::string_view, 3> kNames{"used", "rejected", "expected"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view name_of(TagCandidate::Why why) {
  static constexpr std::array<std::string_view, 5> kNames{"unsearched", "low_margin", "too_small",
                                                          "faint", "unread"};
  return kNames[static_cast<std::size_t>(why)];
}

void corners(JsonWriter& json, const std::array<Eigen::Vector2d, 4>& px) {
  json.name("px");
  json.array([&] {
    for (const Eigen::Vector2d& corner : px) {
      json.value(rounded(corner.x(), 100));
      json.value(rounded(corner.y(), 100));
    }
  });
}

void outline(JsonWriter& json, const ViewOutline& tag) {
  json.object([&] {
    json.member("kind", name_of(tag.kind));
    json.member("id", tag.tag_id);
    json.member("why", fiducap::name_of(tag.why));
    json.member("margin", rounded(tag.decision_margin, 10));
    json.member("hamming", tag.hamming);
    json.member("sharpness", rounded(tag.sharpness, 1000));
    json.member("fit_px", rounded(tag.fit_px, 100));
    json.member("sigma_px", rounded(tag.sigma_px, 10));
    json.member("new", tag.is_new);
    corners(json, tag.corners_px);
  });
}

void candidate(JsonWriter& json, const TagCandidate& tag) {
  json.object([&] {
    json.member("kind", std::string_view("candidate"));
    json.member("id", tag.tag_id >= 0 ? std::optional(tag.tag_id) : std::nullopt);
    json.member("why", name_of(tag.why));
    json.member("margin", rounded(tag.decision_margin, 10));
    json.member("hamming", tag.hamming);
    corners(json, tag.corners_px);
  });
}

void exposure(JsonWriter& json, const ImageMeasures& image) {
  json.object([&] {
    json.member("mean", rounded(image.mean, 10));
    json.member("black", image.black);
    json.member("white", image.white);
    json.member("dark", rounded(image.dark_share, 1e4));
    json.member("bright", rounded(image.bright_share, 1e4));
    json.member("steepest", rounded(image.steepest, 1000));
    json.name("histogram");
    json.array([&] {
      for (const std::uint32_t count : image.histogram) json.value(count);
    });
  });
}

void blur(JsonWriter& json, const ImageBlur& found) {
  json.object([&] {
    json.member("tags", found.tags);
    json.member("focus_px", rounded(found.focus_px, 100));
    json.member("motion_px", rounded(found.motion_px, 100));
    json.member("motion_deg", rounded(found.motion_rad * kDegreesPerRadian, 1));
  });
}

std::string header_of(const CameraView& view, const ViewPicture& picture) {
  JsonWriter json;
  json.object([&] {
    json.member("body", picture.body_id);
    json.member("camera", view.camera);
    json.member("utc_ms", picture.utc_ms);
    json.member("width", view.width);
    json.member("height", view.height);
    json.name("shown");
    json.array([&] {
      json.value(picture.shown_width);
      json.value(picture.shown_height);
    });
    json.member("rate_hz", rounded(view.rate_hz, 10));
    json.member("noise", rounded(view.pixel_noise, 100));
    json.member("speed_px_s", rounded(view.speed_px_s, 1));
    json.name("exposure");
    picture.measures != nullptr ? exposure(json, *picture.measures) : json.value(nullptr);
    json.name("blur");
    blur(json, picture.blur);
    json.member("candidates", picture.has_candidates);
    json.name("outlines");
    json.array([&] {
      for (const TagCandidate& tag : picture.candidates) candidate(json, tag);
      for (const ViewOutline& tag : view.outlines) outline(json, tag);
    });
  });
  return json.take();
}

/// A number and its separator. @return nullopt: invalid
std::optional<int> take_number(std::string_view& text, char end) {
  int number = 0;
  const char* const last = text.data() + text.size();
  const auto [at, failure] = std::from_chars(text.data(), last, number);
  if (failure != std::errc{} || number < 0) return std::nullopt;
  if (at == last ? end != ' ' : *at != end) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(at - text.data()) + (at == last ? 0 : 1));
  return number;
}

std::optional<CameraRequest> take_view_request(std::string_view& text) {
  const auto body = take_number(text, '/');
  const auto camera = body ? take_number(text, '/') : std::nullopt;
  const auto width = camera ? take_number(text, '/') : std::nullopt;
  const auto rate = width ? take_number(text, '/') : std::nullopt;
  const auto candidates = rate ? take_number(text, ' ') : std::nullopt;
  if (!candidates || *candidates > 1) return std::nullopt;
  if (*width < ViewRequest::kLeastWidth_px || *width > ViewRequest::kMostWidth_px)
    return std::nullopt;
  if (*rate < 1 || *rate > ViewRequest::kMostPerSecond) return std::nullopt;
  return CameraRequest{*body, *camera, {*width, *rate, *candidates == 1}};
}

}  // namespace

Expected<std::vector<CameraRequest>> parse_view_requests(std::string_view text) {
  std::vector<CameraRequest> requests;
  while (!text.empty()) {
    const auto request = text.ends_with(' ') ? std::nullopt : take_view_request(text);
    if (!request)
      return fail(ErrorCode::kInvalid,
                  "expected BODY/CAMERA/WIDTH/PER_SECOND/CANDIDATES with width 80 to 4096, per "
                  "second 1 to 10, candidates 0 or 1; request " +
                      std::to_string(requests.size() + 1) + " is different");
    if (requests.size() == kMostViewRequests)
      return fail(ErrorCode::kInvalid,
                  "expected at most " + std::to_string(kMostViewRequests) + " cameras at once");
    requests.push_back(*request);
  }
  return requests;
}

std::string encode_view_list(const ViewAccess& access,
                             std::span<const CameraViews::Camera> cameras) {
  JsonWriter json;
  json.object([&] {
    json.member("type", "views");
    json.member("access", name_of(access.kind));
    json.member("why", access.why);
    json.objects("cameras", cameras, [&](const CameraViews::Camera& camera) {
      json.member("body", camera.body_id);
      json.member("camera", camera.camera);
      json.member("width", camera.width);
      json.member("height", camera.height);
      json.member("rate_hz", camera.rate_hz);
    });
  });
  return json.take();
}

std::string encode_view(const CameraView& view, const ViewPicture& picture,
                        std::span<const std::uint8_t> jpeg) {
  const std::string header = header_of(view, picture);
  std::string message;
  message.reserve(sizeof(std::uint32_t) + header.size() + jpeg.size());
  for (std::size_t i = 0; i < sizeof(std::uint32_t); ++i)
    message += static_cast<char>(header.size() >> (8 * i));
  message += header;
  message.append(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  return message;
}

}  // namespace fiducap::web
