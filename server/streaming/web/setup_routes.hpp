#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "streaming/setup_desk.hpp"
#include "streaming/web/http_routes.hpp"

namespace fiducap::web {

/// `/api/v1/setup` and all below it.
[[nodiscard]] bool is_setup(std::string_view path);

/// One thing that is answered below `/api/v1/setup`.
struct SetupRoute {
  std::string_view method;
  std::string_view what;  ///< After `/api/v1/setup/`; `*`: anything.
  HttpResponse (*answer)(const HttpRequest&, SetupDesk&);
};

/// All there are: GET of the state, of `/picture` and of `/sheet?…`; POST of a command,
/// `/NAME?key=value&…`, without a body.
[[nodiscard]] std::span<const SetupRoute> setup_routes();

/// A request that does not bring the secret of the set-up reaches no route.
/// @param setup    nullptr: no set-up goes on
/// @param is_here  the request comes from this machine, and is not passed on for another one
[[nodiscard]] HttpResponse answer_setup(const HttpRequest& request, SetupDesk* setup, bool is_here);

/// What stands behind the question mark. @return nullopt: not of that form, or too much
[[nodiscard]] std::optional<std::map<std::string, std::string>> query_of(std::string_view target);

}  // namespace fiducap::web
