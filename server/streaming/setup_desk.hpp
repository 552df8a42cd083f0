#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "base/expected.hpp"

namespace fiducap {

/// Leads a person on the page from no camera to a configuration. Implemented in `daemon`, while
/// there is no configuration yet. Called on the pages' thread; every call returns at once.
class SetupDesk {
 public:
  virtual ~SetupDesk() = default;
  /// Is this the secret of this start? Takes the same time for every wrong one.
  [[nodiscard]] virtual bool admits(std::string_view secret) const = 0;
  /// All that the page shows of it, JSON. Never nullptr.
  [[nodiscard]] virtual std::shared_ptr<const std::string> state() const = 0;
  /// The newest image of the camera, JPEG; more are made while they are asked for. @return nullptr:
  /// there is none yet
  [[nodiscard]] virtual std::shared_ptr<const std::string> picture() = 0;
  /// Done a moment later; what becomes of it is in the state.
  /// @return Error: too many wait already
  virtual Expected<void> command(std::string what, std::map<std::string, std::string> values) = 0;
  /// Tags to print, PDF. @param order  `family`, `size_mm`, `paper`
  /// @return Error saying what was expected
  [[nodiscard]] virtual Expected<std::string> sheet(
      std::map<std::string, std::string> order) const = 0;
};

}  // namespace fiducap
