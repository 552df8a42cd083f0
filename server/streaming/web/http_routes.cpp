#include "streaming/web/http_routes.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

#include "middleware/net/peer.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::web {

namespace {

constexpr std::string_view kDiffPath = "/api/v1/map/diff/";

constexpr std::string_view kNoPage = R"(<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Fiducap: no page</title>
<h1>Fiducap is running, its page is not built</h1>
<p>The bundle of the status page was not found beside the program.
To build it, install Node 18 or newer with npm, then</p>
<pre>cmake --preset release -DFIDUCAP_WEB=ON
cmake --build --preset release</pre>
<p>and start the server again; or let <code>streaming.web.root</code> name the folder of a bundle
built elsewhere.</p>
<p>Everything else works: <a href="/api/v1/state">/api/v1/state</a> is the present state as JSON,
<a href="/healthz">/healthz</a> reports whether frames flow, <a href="/metrics">/metrics</a> is for
Prometheus, and <code>/api/v1/live</code> is the
live WebSocket.</p>
</html>
)";

// Both forms of a file have their own tag.
std::string gzip_tag(const std::string& etag) {
  return etag.substr(0, etag.size() - 1) + "-gzip\"";
}

void send(HttpResponse& response, Content content, const HttpRequest& request) {
  response.content = std::move(content);
  response.gzip = response.content.gzip != nullptr && accepts_gzip(request.accept_encoding);
}

HttpResponse file_response(const PageFile& file, const HttpRequest& request) {
  HttpResponse response;
  response.content_type = file.content_type;
  response.cache_control = file.never_changes ? "public, max-age=31536000, immutable" : "no-cache";
  send(response, file.content, request);
  response.etag = response.gzip ? gzip_tag(file.etag) : file.etag;
  if (request.if_none_match.find(response.etag) == std::string_view::npos) return response;
  response.status = 304;
  response.gzip = false;
  response.content = plain_content("");
  return response;
}

HttpResponse json_response(int status, Content json, const HttpRequest& request) {
  HttpResponse response{.status = status, .content_type = "application/json"};
  send(response, std::move(json), request);
  return response;
}

HttpResponse health_response(const Health& health, const HttpRequest& request) {
  std::string alarms;
  for (const Severity severity : {Severity::kError, Severity::kWarning, Severity::kInfo})
    alarms += (alarms.empty() ? "\"" : ",\"") + std::string(name_of(severity)) +
              "\":" + std::to_string(health.alarms[static_cast<std::size_t>(severity)]);
  const std::string status = health.trouble.empty() ? "ok" : health.trouble;
  return json_response(
      health.trouble.empty() ? 200 : 503,
      plain_content("{\"status\":\"" + status + "\",\"alarms\":{" + alarms + "}}\n"), request);
}

HttpResponse diff_response(std::string_view versions, const RouteSources& sources,
                           const HttpRequest& request) {
  const auto slash = versions.find('/');
  const auto before = whole_number<std::int64_t>(versions.substr(0, slash));
  const auto after = slash == std::string_view::npos
                         ? std::nullopt
                         : whole_number<std::int64_t>(versions.substr(slash + 1));
  if (!before || !after)
    return plain_response(400, "expected two versions, as /api/v1/map/diff/3/7\n");
  const auto diff = sources.diff(*before, *after);
  if (!diff) return plain_response(404, diff.error().what + "\n");
  if (!*diff) return later_response(503, "the versions are being read; ask again in a moment\n");
  return json_response(200, **diff, request);
}

std::string lower(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(), [](char c) { return fiducap::lower(c); });
  return out;
}

// `hall` with scheme http is `hall:80`; `[::1]` has colons that are no port.
std::string with_port(std::string host, std::string_view port) {
  const auto colon = host.rfind(':');
  const auto bracket = host.rfind(']');
  const bool has_port =
      colon != std::string::npos && (bracket == std::string::npos || colon > bracket);
  return has_port ? host : host + ":" + std::string(port);
}

/// `[::1]`, `[::1]:8080`. Browsers send no scope.
bool is_bracketed_address(const std::string& host) {
  const auto end = host.find(']');
  if (end == std::string::npos) return false;
  const std::string inside = host.substr(1, end - 1);
  const std::string_view rest = std::string_view(host).substr(end + 1);
  const bool is_port =
      rest.empty() ||
      (rest.front() == ':' && rest.find_first_not_of("0123456789", 1) == std::string_view::npos);
  return is_port && inside.find(':') != std::string::npos &&
         inside.find('%') == std::string::npos && net::is_address(inside);
}

constexpr std::string_view kPath = "/api/v1/setup";
constexpr std::size_t kMostKeys = 16;

/// `/api/v1/setup/x?y` → `x`
std::string_view below_setup(std::string_view target) {
  const std::string_view path = path_of(target);
  return path.size() > kPath.size() ? path.substr(kPath.size() + 1) : "";
}

/// `%41` → `A`, `+` → blank. @return nullopt: a broken escape, or a control character other than \n
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

HttpResponse picture_of(const HttpRequest&, SetupApi& setup) {
  const auto picture = setup.picture();
  if (!picture) return plain_response(404, "there is no picture yet\n");
  return {.content_type = "image/jpeg", .content = {picture}};
}

HttpResponse state_of(const HttpRequest&, SetupApi& setup) {
  return {.content_type = "application/json", .content = {setup.state()}};
}

HttpResponse sheet_of(const HttpRequest& request, SetupApi& setup) {
  auto order = query_of(request.target);
  if (!order) return plain_response(400, "expected ?key=value&key=value\n");
  auto pdf = setup.sheet(std::move(*order));
  if (!pdf) return plain_response(400, pdf.error().text() + "\n");
  return {.content_type = "application/pdf", .content = plain_content(std::move(*pdf))};
}

HttpResponse run_command(const HttpRequest& request, SetupApi& setup) {
  auto values = query_of(request.target);
  if (!values) return plain_response(400, "expected ?key=value&key=value\n");
  const auto taken = setup.command({"set-up", "secret of the set-up", std::string(request.address)},
                                   std::string(below_setup(request.target)), std::move(*values));
  return taken ? plain_response(202, "\n") : later_response(503, taken.error().what + "\n");
}

constexpr std::array<SetupRoute, 4> kRoutes{{{"GET", "", state_of},
                                             {"GET", "picture", picture_of},
                                             {"GET", "sheet", sheet_of},
                                             {"POST", "*", run_command}}};

}  // namespace

HttpResponse plain_response(int status, std::string text) {
  return {.status = status, .content = plain_content(std::move(text))};
}

HttpResponse later_response(int status, std::string text) {
  HttpResponse response = plain_response(status, std::move(text));
  response.retry_after_s = 1;
  return response;
}

std::string_view path_of(std::string_view target) {
  return target.substr(0, target.find_first_of("?#"));
}

HttpResponse answer(const HttpRequest& request, const PageFiles& page,
                    const RouteSources& sources) {
  if (request.method != "GET" && request.method != "HEAD")
    return plain_response(405, "expected GET or HEAD\n");
  const std::string_view path = path_of(request.target);
  if (path == "/api/v1/state") return json_response(200, sources.state(), request);
  if (path == "/healthz") return health_response(sources.health(), request);
  if (path == "/metrics") {
    const MetricsFormat format = metrics_format(request.accept);
    HttpResponse response{.content_type = std::string(content_type_of(format))};
    send(response, sources.metrics(format), request);
    return response;
  }
  if (path == kViewsPath) return json_response(200, sources.views(), request);
  if (path == "/api/v1/map/versions") return json_response(200, sources.versions(), request);
  if (path.starts_with(kDiffPath))
    return diff_response(path.substr(kDiffPath.size()), sources, request);
  if (path == kLivePath || path == kControlPath)
    return plain_response(426, "expected a WebSocket upgrade\n");
  if (const PageFile* file = page.find(path)) return file_response(*file, request);
  if (page.empty() && (path == "/" || path == "/index.html")) {
    HttpResponse response = plain_response(503, std::string(kNoPage));
    response.content_type = "text/html; charset=utf-8";
    return response;
  }
  return plain_response(404, "nothing here; the page is at /\n");
}

bool is_open(std::string_view path) {
  return path != "/metrics" && (!path.starts_with("/api/") || is_setup(path));
}

bool is_our_name(std::string_view host, const std::vector<std::string>& names) {
  std::string name = lower(host);
  if (name.empty()) return true;
  if (name.front() == '[') return is_bracketed_address(name);
  name = name.substr(0, name.rfind(':'));
  if (name.ends_with('.')) name.pop_back();
  if (name == "localhost" || net::parse_address(name)) return true;
  return std::ranges::any_of(names, [&](const std::string& ours) {
    return name == lower(ours) || name == lower(ours) + ".local";
  });
}

bool same_origin(std::string_view origin, std::string_view host) {
  if (origin.empty()) return true;
  const std::string from = lower(origin);
  for (const auto& [scheme, port] : {std::pair{"http://", "80"}, std::pair{"https://", "443"}}) {
    if (from.rfind(scheme, 0) != 0) continue;
    const std::string from_host = from.substr(std::string_view(scheme).size());
    return !from_host.empty() && with_port(from_host, port) == with_port(lower(host), port);
  }
  return false;
}

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

HttpResponse answer_setup(const HttpRequest& request, SetupApi* setup, bool is_here) {
  if (setup == nullptr) {
    // Every page asks for it: no error.
    if (request.method == "GET" && below_setup(request.target).empty())
      return json_response(200, plain_content("null"), request);
    return plain_response(404, "no set-up is running\n");
  }
  if (!is_here)
    return plain_response(403,
                          "The set-up works at this machine only: open the page there, or through "
                          "`ssh -L 8080:127.0.0.1:8080`.\n");
  if (!setup->admits(request.setup)) {
    if (!request.setup.empty() || request.method == "POST")
      setup->note_refusal({"set-up", {}, std::string(request.address)});
    return plain_response(403,
                          "Open the address that fiducapd --setup printed in its terminal, with "
                          "everything after #.\n");
  }
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
