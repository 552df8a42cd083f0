#include "middleware/endpoints.hpp"

#include <dds/dds.h>

#include <algorithm>
#include <array>
#include <memory>

namespace fiducap::dds {

namespace {

struct QosDeleter {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using QosPointer = std::unique_ptr<dds_qos_t, QosDeleter>;

QosPointer make_qos(const Qos& wanted, const std::string& type_hash) {
  QosPointer qos(dds_create_qos());
  // A writer never waits for a reader: refused messages are counted.
  dds_qset_reliability(qos.get(),
                       wanted.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_durability(qos.get(), wanted.for_late_joiners ? DDS_DURABILITY_TRANSIENT_LOCAL
                                                         : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, wanted.depth);
  if (wanted.deadline_s > 0)
    dds_qset_deadline(qos.get(), static_cast<dds_duration_t>(wanted.deadline_s * 1e9));
  // An instance lives until it is disposed of, also after its writer.
  dds_qset_writer_data_lifecycle(qos.get(), false);
  const std::string text = "typehash=" + type_hash + ";";
  if (!type_hash.empty()) dds_qset_userdata(qos.get(), text.data(), text.size());
  return qos;
}

/// Makes the topic in `own`, and its reader or writer by `create`. The topic is without QoS: a
/// participant may read and write it in several ways.
template <typename Create>
Expected<Entity> make_endpoint(const Participant& in, const TopicName& topic, const Qos& qos,
                               Entity& own, Create create, const char* failure) {
  const std::string where = "topic " + topic.name;
  own = Entity(dds_create_topic(in.handle(), topic.type, topic.name.c_str(), nullptr, nullptr));
  if (!own) return failure_of(own.handle(), "the topic cannot be made", where);
  Entity made(create(in.handle(), own.handle(), make_qos(qos, topic.type_hash).get(), nullptr));
  if (!made) return failure_of(made.handle(), failure, where);
  return made;
}

}  // namespace

Expected<Writer> Writer::make(const Participant& in, const TopicName& topic, const Qos& qos) {
  Writer writer;
  auto made =
      make_endpoint(in, topic, qos, writer.topic_, dds_create_writer, "the writer cannot be made");
  if (!made) return tl::unexpected(made.error());
  writer.writer_ = std::move(*made);
  writer.name_ = topic.name;
  return writer;
}

bool Writer::has_readers() const {
  dds_publication_matched_status_t status{};
  return dds_get_publication_matched_status(writer_.handle(), &status) == DDS_RETCODE_OK &&
         status.current_count > 0;
}

std::vector<std::string> Writer::reading_participants() const {
  constexpr std::size_t kMost = 256;
  std::array<dds_instance_handle_t, kMost> readers{};
  const auto count = dds_get_matched_subscriptions(writer_.handle(), readers.data(), kMost);
  std::vector<std::string> participants;
  for (std::size_t i = 0;
       count > 0 && i < std::min<std::size_t>(static_cast<std::size_t>(count), kMost); ++i) {
    dds_builtintopic_endpoint_t* reader =
        dds_get_matched_subscription_data(writer_.handle(), readers[i]);
    if (reader == nullptr) continue;  // the reader has gone
    std::string digits;
    constexpr std::size_t kPrefix = 12;  // the last four bytes are equal for all participants
    for (std::size_t k = 0; k < kPrefix; ++k) {
      constexpr const char* kHex = "0123456789abcdef";
      digits += kHex[reader->participant_key.v[k] >> 4];
      digits += kHex[reader->participant_key.v[k] & 15];
    }
    participants.push_back(std::move(digits));
    dds_builtintopic_free_endpoint(reader);
  }
  return participants;
}

bool Writer::write(const void* sample) {
  const bool taken = dds_write(writer_.handle(), sample) == DDS_RETCODE_OK;
  ++(taken ? written_ : refused_);
  return taken;
}

void Writer::flush() { dds_write_flush(writer_.handle()); }

void Writer::dispose(const void* sample) { dds_dispose(writer_.handle(), sample); }

Expected<Reader> Reader::make(const Participant& in, const TopicName& topic, const Qos& qos) {
  Reader reader;
  auto made =
      make_endpoint(in, topic, qos, reader.topic_, dds_create_reader, "the reader cannot be made");
  if (!made) return tl::unexpected(made.error());
  reader.reader_ = std::move(*made);
  return reader;
}

Expected<WaitSet> WaitSet::make(const Participant& in) {
  WaitSet made;
  made.set_ = Entity(dds_create_waitset(in.handle()));
  if (!made.set_) return failure_of(made.set_.handle(), "cannot wait for messages", "dds");
  return made;
}

Expected<void> WaitSet::add(const Reader& reader) {
  Entity unread(dds_create_readcondition(reader.handle(), DDS_ANY_STATE));
  if (!unread) return failure_of(unread.handle(), "cannot wait for messages", "dds");
  const auto attached = dds_waitset_attach(set_.handle(), unread.handle(), 0);
  if (attached != DDS_RETCODE_OK) return failure_of(attached, "cannot wait for messages", "dds");
  conditions_.push_back(std::move(unread));
  return {};
}

bool WaitSet::wait(Duration timeout) {
  return dds_waitset_wait(set_.handle(), nullptr, 0, timeout.count()) > 0;
}

Reader::Loan::~Loan() {
  if (sample_ != nullptr) dds_return_loan(reader_, &sample_, 1);
}

Reader::Loan Reader::take() {
  for (;;) {
    void* sample = nullptr;
    dds_sample_info_t info{};
    if (dds_take(reader_.handle(), &sample, &info, 1, 1) <= 0) return {};
    Loan loan(reader_.handle(), sample);
    if (info.valid_data) return loan;  // otherwise a writer has gone
  }
}

}  // namespace fiducap::dds
