#include "middleware/participant.hpp"

#include <dds/dds.h>
#include <dds/ddsrt/log.h>

#include <algorithm>
#include <array>
#include <set>
#include <string_view>
#include <thread>

#include "base/log.hpp"

namespace fiducap::dds {

namespace {

struct ListenerDeleter {
  void operator()(dds_listener_t* listener) const { dds_delete_listener(listener); }
};

/// Logs the first warnings only: an unplugged cable or a hostile peer must not fill the disk.
void log_some(void*, const dds_log_data_t* data) {
  constexpr int kMost = 20;
  static std::atomic<int> logged{0};
  if (data->message == nullptr ||
      (data->priority & (DDS_LC_WARNING | DDS_LC_ERROR | DDS_LC_FATAL)) == 0)
    return;
  const int count = ++logged;
  if (count > kMost) return;
  std::string_view text(data->message);
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.remove_suffix(1);
  log::warning("dds", text);
  if (count == kMost) log::warning("dds", "further warnings are dropped");
}

}  // namespace

tl::unexpected<Error> failure_of(std::int32_t code, const std::string& what,
                                 const std::string& context) {
  return fail(ErrorCode::kUnavailable, what + " (" + dds_strretcode(code) + ")", context);
}

Entity::~Entity() {
  if (handle_ > 0) dds_delete(handle_);
}

Expected<std::shared_ptr<Participant>> Participant::open(const NetworkConfig& config, Alarm alarm) {
  const std::string where = "domain " + std::to_string(config.domain);
  const AllowedSenders senders = allowed_senders(config);
  const std::string xml = cyclone_xml(config, senders);
  dds_set_log_sink(log_some, nullptr);
  Entity domain(dds_create_domain(static_cast<dds_domainid_t>(config.domain), xml.c_str()));
  if (domain.handle() == DDS_RETCODE_PRECONDITION_NOT_MET)
    return fail(ErrorCode::kUnavailable,
                "this process takes part in the domain already: set dds.domain to another one",
                where);
  const std::string remedy =
      "cannot take part: is dds.interface = \"" + config.interface +
      "\" one of this machine's (`ip address` lists them), and are there fewer than " +
      std::to_string(config.max_participants) + " participants (dds.max_participants)?";
  if (!domain) return failure_of(domain.handle(), remedy, where);
  if (auto restricted = restrict_sockets(config.domain, senders); !restricted)
    return tl::unexpected(restricted.error());
  Entity participant(
      dds_create_participant(static_cast<dds_domainid_t>(config.domain), nullptr, nullptr));
  if (!participant) return failure_of(participant.handle(), remedy, where);
  std::shared_ptr<Participant> opened(new Participant(std::move(domain), std::move(participant),
                                                      config.domain, senders, std::move(alarm)));
  return opened->watch().map([&] { return std::move(opened); });
}

void Participant::look_at_cards() {
  if (!senders_.loopback_only || cards_changed_) return;
  const std::vector<std::string> now = local_cards();
  const auto is_left = [&](const std::string& card) { return std::ranges::count(now, card) > 0; };
  if (now.empty() || std::ranges::any_of(senders_.cards, is_left)) return;
  log::info("dds", "joins the domain again: this machine has another network card now");
  cards_changed_ = true;
}

Expected<void> Participant::watch() {
  const std::unique_ptr<dds_listener_t, ListenerDeleter> listener(dds_create_listener(this));
  dds_lset_data_available(listener.get(), [](dds_entity_t reader, void* self) {
    static_cast<Participant*>(self)->take_samples(reader);
  });
  const auto reader =
      dds_create_reader(handle(), DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, listener.get());
  if (reader > 0) return {};
  return failure_of(reader, "cannot count participants", "dds");
}

void Participant::take_samples(std::int32_t reader) {
  constexpr std::size_t kAtOnce = 16;
  std::array<void*, kAtOnce> samples{};
  std::array<dds_sample_info_t, kAtOnce> about{};
  for (;;) {
    samples[0] = nullptr;  // on loan
    const auto taken = dds_take(reader, samples.data(), about.data(), kAtOnce, kAtOnce);
    if (taken <= 0) return;
    for (std::size_t i = 0; i < static_cast<std::size_t>(taken); ++i) {
      const bool is_new = about[i].view_state == DDS_VST_NEW;
      const bool is_alive = about[i].instance_state == DDS_IST_ALIVE;
      if (is_new) ++seen_;
      if (is_new && is_alive) ++present_;
      if (!is_new && !is_alive) --present_;
      if (!count().is_plausible() && !flooded_.exchange(true) && alarm_) alarm_(count());
    }
    dds_return_loan(reader, samples.data(), taken);
  }
}

void Membership::look_at_cards() {
  const std::lock_guard lock(mutex_);
  if (const auto held = participant_.lock()) held->look_at_cards();
}

Expected<std::shared_ptr<Participant>> Membership::join() {
  const std::lock_guard lock(mutex_);
  const std::string domain = "domain " + std::to_string(config_.domain);
  if (auto held = participant_.lock()) {
    if (!held->is_to_be_left()) return held;
    return fail(ErrorCode::kUnavailable, "leaves the domain and joins it again soon", domain);
  }
  if (!*has_left_)
    return fail(ErrorCode::kUnavailable, "is still leaving the domain and joins it again soon",
                domain);
  auto joined = Participant::open(config_, [this, domain](const ParticipantCount& count) {
    events_.begin(
        {.severity = Severity::kWarning,
         .subject = "dds",
         .kind = "crowded",
         .text = "left " + domain + " for a short time: " + std::to_string(count.present) +
                 " participants at once, " + std::to_string(count.seen) + " since it was joined",
         .remedy = "If there are fewer ROS nodes, the others are forged: see "
                   "docs/design/dds-exposure.md"});
  });
  if (!joined) return joined;
  *has_left_ = false;
  const std::shared_ptr<Participant> held(
      (*joined).get(), [inner = *joined, left = has_left_](Participant*) mutable {
        inner.reset();
        *left = true;
      });
  participant_ = held;
  events_.end("dds", "crowded", "has joined the domain again");
  return held;
}

namespace {

using Key = std::array<std::uint8_t, 16>;

Key key_of(const dds_guid_t& guid) { return std::to_array(guid.v); }

/// Calls `see(sample)` for each present sample of a built-in topic.
template <typename Sample, typename See>
void for_each_present(std::int32_t reader, See see) {
  constexpr std::size_t kMost = 256;
  std::array<void*, kMost> samples{};  // on loan
  std::array<dds_sample_info_t, kMost> about{};
  const auto read = dds_read(reader, samples.data(), about.data(), kMost, kMost);
  for (std::int32_t i = 0; i < read; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (about[k].valid_data) see(*static_cast<const Sample*>(samples[k]));
  }
  if (read > 0) dds_return_loan(reader, samples.data(), read);
}

bool is_process(const dds_builtintopic_participant_t& participant, std::string_view process) {
  char* name = nullptr;
  const bool named = dds_qget_prop(participant.qos, "__ProcessName", &name);
  const bool is = named && name != nullptr && process == name;
  dds_free(name);
  return is;
}

}  // namespace

Expected<bool> is_found_by_default(int domain, std::string_view process, Duration wait) {
  constexpr auto kPause = std::chrono::milliseconds(50);
  const std::string where = "domain " + std::to_string(domain);
  // All defaults, but multicast ends on this machine.
  Entity joined(dds_create_domain(
      static_cast<dds_domainid_t>(domain),
      "<CycloneDDS><Domain Id=\"any\"><General><MulticastTimeToLive>0</MulticastTimeToLive>"
      "</General><Tracing><Verbosity>none</Verbosity></Tracing></Domain></CycloneDDS>"));
  if (!joined) return failure_of(joined.handle(), "cannot join with default settings", where);
  AllowedSenders senders;
  senders.loopback_only = true;
  if (auto done = restrict_sockets(domain, senders); !done) return tl::unexpected(done.error());
  const Entity participant(
      dds_create_participant(static_cast<dds_domainid_t>(domain), nullptr, nullptr));
  const auto participants =
      dds_create_reader(participant.handle(), DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr);
  const auto topics =
      dds_create_reader(participant.handle(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr);
  if (topics < 0) return failure_of(topics, "cannot join with default settings", where);
  for (Duration waited{}; waited < wait; waited += kPause) {
    std::set<Key> sought;
    for_each_present<dds_builtintopic_participant_t>(participants, [&](const auto& one) {
      if (is_process(one, process)) sought.insert(key_of(one.key));
    });
    bool found = false;
    for_each_present<dds_builtintopic_endpoint_t>(topics, [&](const auto& one) {
      found = found || sought.contains(key_of(one.participant_key));
    });
    if (found) return true;
    std::this_thread::sleep_for(kPause);
  }
  return false;
}

}  // namespace fiducap::dds
