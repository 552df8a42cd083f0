#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "streaming/setup_desk.hpp"
#include "streaming/web/http_routes.hpp"

namespace fiducap::web {

/// `/api/v1/setup` and all below it.
[[nodiscard]] bool is_setup(std::string_view path);

/// GET of the state, of `/picture` and of `/sheet?…`; POST of a command, `/NAME?key=value&…`,
/// without a body.
/// @param setup    nullptr: no set-up goes on
/// @param is_here  somebody at this machine asks, and for nobody else
[[nodiscard]] HttpResponse answer_setup(const HttpRequest& request, SetupDesk* setup, bool is_here);

/// What stands behind the question mark. @return nullopt: not of that form, or too much
[[nodiscard]] std::optional<std::map<std::string, std::string>> query_of(std::string_view target);

}  // namespace fiducap::web
