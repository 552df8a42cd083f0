#include "streaming/vrpn/sender_table.hpp"

#include <algorithm>
#include <utility>

#include "base/assert.hpp"
#include "streaming/vrpn/protocol.hpp"

namespace fiducap::vrpn {

std::vector<ConfigError> check_body_name(const std::string& path, std::string_view name) {
  const bool plain = std::none_of(name.begin(), name.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte < 0x20 || byte == 0x7f;
  });
  return Checker{""}
      .require(!name.empty() && name.size() <= kMaxNameBytes, path, name,
               "must have 1 to 95 bytes (VRPN clients drop the connection at longer names)")
      .require(name.find('@') == std::string_view::npos, path, name,
               "must not contain '@' (VRPN clients write name@host)")
      .require(plain, path, name, "must not contain control characters")
      .require(name != kControlName, path, name, "is the name of VRPN's own control sender")
      .errors;
}

SenderTable::SenderTable(NameAliases aliases)
    : aliases_(std::move(aliases)), names_{std::string(kControlName)} {}

std::vector<std::string> SenderTable::update(const SceneModel& model) {
  std::vector<std::string> refused;
  if (generation_ == model.generation) return refused;
  generation_ = model.generation;
  of_bodies_.clear();
  own_names_.clear();
  for (const auto& body : model.bodies) {
    const auto alias = aliases_.find(body.name);
    const std::string& name = alias == aliases_.end() ? body.name : alias->second;
    const std::int32_t id = check_body_name("", name).empty() ? id_for(name) : kNone;
    const bool doubled = std::find(of_bodies_.begin(), of_bodies_.end(), id) != of_bodies_.end();
    of_bodies_.push_back(doubled ? kNone : id);
    own_names_.push_back(body.name);
    if (of_bodies_.back() == kNone) refused.push_back(name);
  }
  return refused;
}

std::int32_t SenderTable::id_for(const std::string& name) {
  const auto known = std::find(names_.begin(), names_.end(), name);
  const auto id = static_cast<std::int32_t>(known - names_.begin());
  if (known != names_.end()) return id;
  if (id >= kMaxIds) return kNone;
  names_.push_back(name);
  return id;
}

std::optional<std::int32_t> SenderTable::find_body(std::string_view name) const {
  for (const std::int32_t id : of_bodies_) {
    if (id != kNone && names_[static_cast<std::size_t>(id)] == name) return id;
  }
  return std::nullopt;
}

const std::string& SenderTable::own_name_of(std::int32_t id) const {
  const auto at = std::find(of_bodies_.begin(), of_bodies_.end(), id);
  FIDUCAP_ASSERT(at != of_bodies_.end());
  return own_names_[static_cast<std::size_t>(at - of_bodies_.begin())];
}

std::string SenderTable::list_bodies() const {
  std::string list;
  for (const std::int32_t id : of_bodies_) {
    if (id == kNone) continue;
    if (!list.empty()) list += ", ";
    list += names_[static_cast<std::size_t>(id)];
  }
  return list.empty() ? "none" : list;
}

}  // namespace fiducap::vrpn
