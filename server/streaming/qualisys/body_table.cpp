#include "streaming/qualisys/body_table.hpp"

#include <algorithm>

#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap::qualisys {

bool BodyTable::update(const SceneModel& model) {
  if (generation_ == model.generation) return false;
  generation_ = model.generation;
  const auto names = client_names(model, conventions_of("qualisys").names, aliases_);
  for (Entry& entry : entries_) entry.enabled = false;
  index_of_body_.clear();
  for (std::size_t i = 0; i < model.bodies.size(); ++i) {
    const int id = model.bodies[i].id;
    auto entry = std::find_if(entries_.begin(), entries_.end(),
                              [id](const Entry& known) { return known.id == id; });
    if (entry == entries_.end()) entry = entries_.insert(entries_.end(), Entry{id, {}, true});
    entry->name = names[i];
    entry->enabled = true;
    index_of_body_.push_back(static_cast<std::size_t>(entry - entries_.begin()));
  }
  return true;
}

}  // namespace fiducap::qualisys
