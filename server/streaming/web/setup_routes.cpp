#include "streaming/web/setup_routes.hpp"

#include <array>
#include <charconv>
#include <memory>
#include <utility>

namespace fiducap::web {

namespace {

constexpr std::string_view kPath = "/api/v1/setup";
constexpr std::size_t kMostKeys = 16;

/// `/api/v1/setup/x?y` → `x`
std::string_view below_setup(std::string_view target) {
  const std::string_view path = path_of(target);
  return path.size() > kPath.size() ? path.substr(kPath.size() + 1) : "";
}

/// `%41` → `A`, `+` → blank. @return nullopt: a broken escape, or a control character but a line
/// end
std::optional<std::string> unescaped(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i] == '+' ? ' ' : text[i];
    if (text[i] == '%') {
      unsigned value{};
      const char* const from = text.data() + i + 1;
      if (i + 2 >= text.size()) return std::nullopt;
      const auto [end, failure] = std::from_chars(from, from + 2, value, 16);
      if (failure != std::errc{} || end != from + 2) return std::nullopt;
      c = static_cast<char>(value);
      i += 2;
    }
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n') || byte == 0x7f) return std::nullopt;
    out += c;
  }
  return out;
}

HttpResponse picture_of(const HttpRequest&, SetupDesk& setup) {
  const auto picture = setup.picture();
  if (!picture) return plain_response(404, "there is no picture yet\n");
  HttpResponse response;
  response.content_type = "image/jpeg";
  response.content.plain = picture;
  return response;
}

HttpResponse state_of(const HttpRequest&, SetupDesk& setup) {
  HttpResponse response;
  response.content_type = "application/json";
  response.content.plain = setup.state();
  return response;
}

HttpResponse sheet_of(const HttpRequest& request, SetupDesk& setup) {
  auto order = query_of(request.target);
  if (!order) return plain_response(400, "expected ?key=value&key=value\n");
  auto pdf = setup.sheet(std::move(*order));
  if (!pdf) return plain_response(400, pdf.error().text() + "\n");
  HttpResponse response;
  response.content_type = "application/pdf";
  response.content.plain = std::make_shared<const std::string>(std::move(*pdf));
  return response;
}

HttpResponse obey(const HttpRequest& request, SetupDesk& setup) {
  auto values = query_of(request.target);
  if (!values) return plain_response(400, "expected ?key=value&key=value\n");
  const auto taken = setup.command(std::string(below_setup(request.target)), std::move(*values));
  return taken ? plain_response(202, "\n") : later_response(503, taken.error().what + "\n");
}

constexpr std::array<SetupRoute, 4> kRoutes{{{"GET", "", state_of},
                                             {"GET", "picture", picture_of},
                                             {"GET", "sheet", sheet_of},
                                             {"POST", "*", obey}}};

}  // namespace

std::span<const SetupRoute> setup_routes() { return kRoutes; }

bool is_setup(std::string_view path) {
  return path.starts_with(kPath) && (path.size() == kPath.size() || path[kPath.size()] == '/');
}

std::optional<std::map<std::string, std::string>> query_of(std::string_view target) {
  std::map<std::string, std::string> values;
  const auto mark = target.find('?');
  std::string_view rest = mark == std::string_view::npos ? "" : target.substr(mark + 1);
  while (!rest.empty()) {
    const auto end = rest.find('&');
    const std::string_view pair = rest.substr(0, end);
    rest = end == std::string_view::npos ? "" : rest.substr(end + 1);
    const auto equals = pair.find('=');
    if (equals == std::string_view::npos || values.size() >= kMostKeys) return std::nullopt;
    auto key = unescaped(pair.substr(0, equals));
    auto value = unescaped(pair.substr(equals + 1));
    if (!key || !value) return std::nullopt;
    values.insert_or_assign(std::move(*key), std::move(*value));
  }
  return values;
}

HttpResponse answer_setup(const HttpRequest& request, SetupDesk* setup, bool is_here) {
  if (setup == nullptr) return plain_response(404, "no set-up goes on\n");
  if (!is_here)
    return plain_response(403,
                          "A set-up is led at this machine only: open the page there, or through "
                          "`ssh -L 8080:127.0.0.1:8080`.\n");
  if (!setup->admits(request.setup))
    return plain_response(403,
                          "Open the address that fiducapd --setup printed in its terminal, with "
                          "everything after #.\n");
  const std::string_view what = below_setup(request.target);
  bool knows_method = false;
  for (const SetupRoute& route : kRoutes) {
    if (route.method != request.method) continue;
    if (route.what == what || route.what == "*") return route.answer(request, *setup);
    knows_method = true;
  }
  return knows_method ? plain_response(404, "nothing here\n")
                      : plain_response(405, "expected GET or POST\n");
}

}  // namespace fiducap::web
