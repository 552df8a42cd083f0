#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "streaming/page_api.hpp"
#include "streaming/web/content.hpp"
#include "streaming/web/metrics.hpp"

namespace fiducap::web {

inline constexpr std::string_view kLivePath = "/api/v1/live";
/// The native control channel (`proto/fiducap/v1/control.proto`) in binary messages.
inline constexpr std::string_view kControlPath = "/api/v1/control";
/// Pictures of cameras; a plain request gets the access rule and the list of cameras.
inline constexpr std::string_view kViewsPath = "/api/v1/views";

/// A request, as views of its parts.
struct HttpRequest {
  std::string_view method;
  std::string_view target;
  std::string_view if_none_match{};
  std::string_view accept_encoding{};
  std::string_view accept{};
  std::string_view setup{};    ///< `X-Fiducap-Setup`: secret of the set-up.
  std::string_view address{};  ///< Of the client.
};

struct HttpResponse {
  int status{200};
  std::string content_type{"text/plain; charset=utf-8"};
  Content content{};
  bool gzip{};         ///< Send the compressed content.
  std::string etag{};  ///< Empty: none.
  std::string cache_control{"no-store"};
  int retry_after_s{0};  ///< 0: none.

  /// The bytes to send.
  [[nodiscard]] const std::shared_ptr<const std::string>& body() const {
    return gzip ? content.gzip : content.plain;
  }
};

/// Content of `/healthz`.
struct Health {
  std::string trouble;                  ///< Empty: healthy; else one sentence.
  std::array<std::size_t, 3> alarms{};  ///< Current conditions, by Severity.
};

/// Sources of the changing replies.
struct RouteSources {
  std::function<Content()> state;  ///< JSON of `/api/v1/state`
  std::function<Health()> health;
  std::function<Content(MetricsFormat)> metrics;
  std::function<Content()> views{};     ///< JSON of `/api/v1/views`
  std::function<Content()> versions{};  ///< JSON of `/api/v1/map/versions`
  /// JSON of `/api/v1/map/diff/BEFORE/AFTER`. @return nullopt: they are being read
  std::function<Expected<std::optional<Content>>(std::int64_t before, std::int64_t after)> diff{};
};

/// @return a request at this path needs no token for reading
[[nodiscard]] bool is_open(std::string_view path);

[[nodiscard]] HttpResponse plain_response(int status, std::string text);

/// With Retry-After, for too many requests or clients.
[[nodiscard]] HttpResponse later_response(int status, std::string text);

/// GET and HEAD of the page, `/api/v1/state`, `/api/v1/map/versions`, `/api/v1/map/diff/A/B`,
/// `/api/v1/views`, `/metrics` and `/healthz`; others: error status with one line of text.
[[nodiscard]] HttpResponse answer(const HttpRequest& request, const PageFiles& page,
                                  const RouteSources& sources);

/// The path of a target without its query: `/x?y` → `/x`.
[[nodiscard]] std::string_view path_of(std::string_view target);

/// @return a page of `origin` may open a socket of `host`. Programs other than browsers send no
/// origin and may.
/// @param origin  e.g. `http://hall:8080`   @param host  e.g. `hall:8080`
[[nodiscard]] bool same_origin(std::string_view origin, std::string_view host);

/// @return `host` is a name of this server. Prevents DNS rebinding, where a foreign page resolves
/// its name to our address. IP addresses, `localhost` and an empty name are always valid.
/// @param host  of the request, e.g. `hall:8080`   @param names  this machine's and configured ones
[[nodiscard]] bool is_our_name(std::string_view host, const std::vector<std::string>& names);

/// Sent with every reply: no foreign content in the page, no page in foreign frames.
inline constexpr std::string_view kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src "
    "'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// `/api/v1/setup` and all below it.
[[nodiscard]] bool is_setup(std::string_view path);

/// One route below `/api/v1/setup`.
struct SetupRoute {
  std::string_view method;
  std::string_view what;  ///< After `/api/v1/setup/`; `*`: any.
  HttpResponse (*answer)(const HttpRequest&, SetupApi&);
};

/// All routes: GET of the state, of `/picture` and of `/sheet?…`; POST of a command,
/// `/NAME?key=value&…`, without a body.
[[nodiscard]] std::span<const SetupRoute> setup_routes();

/// A request without the secret of the set-up reaches no route.
/// @param setup    nullptr: no set-up is running
/// @param is_here  the request is from this machine and not forwarded
[[nodiscard]] HttpResponse answer_setup(const HttpRequest& request, SetupApi* setup, bool is_here);

/// The query of a target. @return nullopt: invalid, or too long
[[nodiscard]] std::optional<std::map<std::string, std::string>> query_of(std::string_view target);

}  // namespace fiducap::web
