#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "streaming/web/page_files.hpp"

namespace fiducap::web {

inline constexpr std::string_view kLivePath = "/api/v1/live";

/// What a route looks at. Views live as long as the request.
struct HttpRequest {
  std::string_view method;
  std::string_view target;
  std::string_view if_none_match;
};

struct HttpResponse {
  int status{200};
  std::string content_type{"text/plain; charset=utf-8"};
  std::shared_ptr<const std::string> body;
  std::string etag;  ///< Empty: none.
  std::string cache_control{"no-store"};
};

/// Where the changing answers come from.
struct RouteSources {
  std::function<std::string()> state;   ///< JSON of `/api/v1/state`
  std::function<std::string()> health;  ///< Empty: well; else what is wrong.
};

[[nodiscard]] HttpResponse plain_response(int status, std::string text);

/// GET and HEAD of the page, `/api/v1/state` and `/healthz`; everything else is an error status
/// with one plain line.
[[nodiscard]] HttpResponse answer(const HttpRequest& request, const PageFiles& page,
                                  const RouteSources& sources);

/// The path of a target without its query: `/x?y` → `/x`.
[[nodiscard]] std::string_view path_of(std::string_view target);

/// May a page of `origin` open the live socket of `host`? Programs that are no browser send no
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
