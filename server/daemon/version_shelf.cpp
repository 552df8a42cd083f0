#include "daemon/version_shelf.hpp"

#include <algorithm>
#include <string>

namespace fiducap {

namespace {

constexpr std::size_t kMostHere = 8;
constexpr std::size_t kMostWanted = 8;  // further ones ask again

bool contains(const VersionShelf::Log& log, std::int64_t version) {
  return std::any_of(log.begin(), log.end(),
                     [&](const MapVersionInfo& one) { return one.version == version; });
}

}  // namespace

std::shared_ptr<const VersionShelf::Log> VersionShelf::log() const {
  const std::lock_guard lock(mutex_);
  return log_;
}

bool VersionShelf::has(std::int64_t version) const { return contains(*log(), version); }

VersionShelf::Content VersionShelf::version(std::int64_t version) {
  const std::lock_guard lock(mutex_);
  if (!contains(*log_, version))
    return fail(ErrorCode::kNotFound,
                "there is no version " + std::to_string(version) + " in the store");
  const auto found = std::find_if(here_.begin(), here_.end(),
                                  [&](const auto& one) { return one.first == version; });
  if (found != here_.end()) return found->second;
  const bool is_asked_for = std::find(wanted_.begin(), wanted_.end(), version) != wanted_.end();
  if (!is_asked_for && wanted_.size() < kMostWanted) wanted_.push_back(version);
  return nullptr;
}

void VersionShelf::put_log(Log log) {
  auto next = std::make_shared<const Log>(std::move(log));
  const std::lock_guard lock(mutex_);
  log_ = std::move(next);
}

std::vector<std::int64_t> VersionShelf::take_wanted() {
  const std::lock_guard lock(mutex_);
  return std::exchange(wanted_, {});
}

void VersionShelf::put(std::int64_t version, Content content) {
  const std::lock_guard lock(mutex_);
  here_.emplace_back(version, std::move(content));
  if (here_.size() > kMostHere) here_.pop_front();
}

}  // namespace fiducap
