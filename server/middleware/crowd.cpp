#include "middleware/crowd.hpp"

#include <dds/dds.h>

#include <array>
#include <memory>
#include <string>

namespace fiducap::dds {

namespace {

struct ListenerDeleter {
  void operator()(dds_listener_t* listener) const { dds_delete_listener(listener); }
};

}  // namespace

Expected<void> CrowdWatch::watch(std::int32_t participant) {
  const std::unique_ptr<dds_listener_t, ListenerDeleter> listener(dds_create_listener(this));
  dds_lset_data_available(listener.get(), [](dds_entity_t reader, void* self) {
    static_cast<CrowdWatch*>(self)->look(reader);
  });
  const auto reader =
      dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, listener.get());
  if (reader > 0) return {};
  return fail(ErrorCode::kUnavailable,
              std::string("cannot count participants (") + dds_strretcode(reader) + ")", "dds");
}

void CrowdWatch::look(std::int32_t reader) {
  constexpr std::size_t kAtOnce = 16;
  std::array<void*, kAtOnce> samples{};
  std::array<dds_sample_info_t, kAtOnce> about{};
  for (;;) {
    samples[0] = nullptr;  // on loan
    const auto taken = dds_take(reader, samples.data(), about.data(), kAtOnce, kAtOnce);
    if (taken <= 0) return;
    for (std::size_t i = 0; i < static_cast<std::size_t>(taken); ++i)
      count(about[i].view_state == DDS_VST_NEW, about[i].instance_state == DDS_IST_ALIVE);
    dds_return_loan(reader, samples.data(), taken);
  }
}

void CrowdWatch::count(bool is_new, bool is_alive) {
  if (is_new) ++met_;
  if (is_new && is_alive) ++present_;
  if (!is_new && !is_alive) --present_;
  if (crowd().is_too_big() && !crowded_.exchange(true) && alarm_) alarm_(crowd());
}

}  // namespace fiducap::dds
