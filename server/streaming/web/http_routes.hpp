#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "streaming/web/content.hpp"
#include "streaming/web/metrics.hpp"
#include "streaming/web/page_files.hpp"

namespace fiducap::web {

inline constexpr std::string_view kLivePath = "/api/v1/live";
/// The control channel of the native protocol (`proto/fiducap/v1/control.proto`), its bytes in
/// binary messages.
inline constexpr std::string_view kControlPath = "/api/v1/control";
/// Pictures of cameras; a plain request is told who gets them, and of which cameras.
inline constexpr std::string_view kViewsPath = "/api/v1/views";

/// What a route looks at. Views live as long as the request.
struct HttpRequest {
  std::string_view method;
  std::string_view target;
  std::string_view if_none_match{};
  std::string_view accept_encoding{};
  std::string_view accept{};
  std::string_view setup{};  ///< `X-Fiducap-Setup`: the secret of the set-up.
};

struct HttpResponse {
  int status{200};
  std::string content_type{"text/plain; charset=utf-8"};
  Content content;
  bool gzip{};       ///< The compressed one is sent.
  std::string etag;  ///< Empty: none.
  std::string cache_control{"no-store"};
  int retry_after_s{0};  ///< 0: nothing is said.

  /// What is sent.
  [[nodiscard]] const std::shared_ptr<const std::string>& body() const {
    return gzip ? content.gzip : content.plain;
  }
};

/// What `/healthz` says.
struct Health {
  std::string trouble;                  ///< Empty: well; else one sentence.
  std::array<std::size_t, 3> alarms{};  ///< Standing conditions, by Severity.
};

/// Where the changing answers come from.
struct RouteSources {
  std::function<Content()> state;  ///< JSON of `/api/v1/state`
  std::function<Health()> health;
  std::function<Content(MetricsFormat)> metrics;
  std::function<Content()> views{};     ///< JSON of `/api/v1/views`
  std::function<Content()> versions{};  ///< JSON of `/api/v1/map/versions`
  /// JSON of `/api/v1/map/diff/BEFORE/AFTER`. @return nullopt: it is being read
  std::function<Expected<std::optional<Content>>(std::int64_t before, std::int64_t after)> diff{};
};

[[nodiscard]] HttpResponse plain_response(int status, std::string text);

/// For who asks too much, or too many: come again in a second.
[[nodiscard]] HttpResponse later_response(int status, std::string text);

/// GET and HEAD of the page, `/api/v1/state`, `/api/v1/map/versions`, `/api/v1/map/diff/A/B`,
/// `/api/v1/views`, `/metrics` and `/healthz`; everything else is an error status with one plain
/// line.
[[nodiscard]] HttpResponse answer(const HttpRequest& request, const PageFiles& page,
                                  const RouteSources& sources);

/// The path of a target without its query: `/x?y` → `/x`.
[[nodiscard]] std::string_view path_of(std::string_view target);

/// May a page of `origin` open a socket of `host`? Programs that are no browser send no
/// origin and may.
/// @param origin  e.g. `http://hall:8080`   @param host  e.g. `hall:8080`
[[nodiscard]] bool same_origin(std::string_view origin, std::string_view host);

/// Is this a name of ours? A page from elsewhere can have its own name resolve to our address (DNS
/// rebinding) and would then pass for the same origin. IP addresses, `localhost` and no name at all
/// (a program, no browser) are always ours.
/// @param host  of the request, e.g. `hall:8080`   @param names  this machine's and configured ones
[[nodiscard]] bool is_our_name(std::string_view host, const std::vector<std::string>& names);

/// Sent with every answer: nothing from elsewhere runs in the page, and the page runs nowhere else.
inline constexpr std::string_view kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src "
    "'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

}  // namespace fiducap::web
