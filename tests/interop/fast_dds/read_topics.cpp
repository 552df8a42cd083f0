#include <array>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>
#include <thread>

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include "fiducapPubSubTypes.h"
#include "peer.hpp"
#include "ros_geometryPubSubTypes.h"
#include "ros_mocapPubSubTypes.h"

namespace fast_dds_peer {
namespace {

std::string text(const geometry_msgs::msg::dds_::Pose_& pose) {
  std::ostringstream out;
  out.precision(9);
  out << "p=" << pose.position().x() << ',' << pose.position().y() << ',' << pose.position().z()
      << " q_xyzw=" << pose.orientation().x() << ',' << pose.orientation().y() << ','
      << pose.orientation().z() << ',' << pose.orientation().w();
  return out.str();
}

template <typename Numbers>
std::string list(const Numbers& numbers) {
  std::ostringstream out;
  out.precision(9);
  for (const auto number : numbers)
    out << (out.tellp() > 0 ? "," : "") << static_cast<double>(number);
  return out.str();
}

std::string text(const geometry_msgs::msg::dds_::Vector3_& v) {
  return list(std::array{v.x(), v.y(), v.z()});
}

// The printed values of each type.
std::string show(const geometry_msgs::msg::dds_::PoseStamped_& m) {
  return "frame=" + m.header().frame_id() + " " + text(m.pose());
}
std::string show(const geometry_msgs::msg::dds_::TwistStamped_& m) {
  return "frame=" + m.header().frame_id() + " v=" + text(m.twist().linear()) +
         " w=" + text(m.twist().angular());
}
std::string show(const nav_msgs::msg::dds_::Odometry_& m) {
  return "frame=" + m.header().frame_id() + " child=" + m.child_frame_id() + " " +
         text(m.pose().pose()) + " v=" + text(m.twist().twist().linear()) +
         " w=" + text(m.twist().twist().angular()) + " pose_cov=" + list(m.pose().covariance()) +
         " twist_cov=" + list(m.twist().covariance());
}
std::string show(const tf2_msgs::msg::dds_::TFMessage_& m) {
  std::string out = "transforms=" + std::to_string(m.transforms().size());
  for (const auto& one : m.transforms()) {
    out += " " + one.header().frame_id() + ">" + one.child_frame_id() + "@" +
           text(one.transform().translation());
  }
  return out;
}
std::string show(const motion_capture_tracking_interfaces::msg::dds_::NamedPoseArray_& m) {
  std::string out = "frame=" + m.header().frame_id();
  for (const auto& one : m.poses()) out += " " + one.name() + " " + text(one.pose());
  return out;
}
std::string show(const mocap4r2_msgs::msg::dds_::RigidBodies_& m) {
  std::string out = "number=" + std::to_string(m.frame_number());
  for (const auto& one : m.rigidbodies())
    out += " " + one.rigid_body_name() + " " + text(one.pose());
  return out;
}
std::string show(const diagnostic_msgs::msg::dds_::DiagnosticArray_& m) {
  std::string out;
  for (const auto& one : m.status()) {
    out += "[" + one.name() + "|" + std::to_string(one.level()) + "|" + one.message();
    for (const auto& value : one.values()) out += "|" + value.key() + "=" + value.value();
    out += "]";
  }
  return out;
}
std::string show(const px4_msgs::msg::dds_::VehicleOdometry_& m) {
  return "frame=" + std::to_string(m.pose_frame()) + " p=" + list(m.position()) +
         " q_wxyz=" + list(m.q()) + " v=" + list(m.velocity()) +
         " w=" + list(m.angular_velocity()) + " p_var=" + list(m.position_variance()) +
         " reset=" + std::to_string(m.reset_counter()) +
         " quality=" + std::to_string(static_cast<int>(m.quality()));
}
std::string show(const fiducap::dds::Body& m) {
  return "id=" + std::to_string(m.id()) + " name=" + m.name() +
         " valid=" + std::to_string(m.valid()) +
         " state=" + std::to_string(static_cast<int>(m.state())) + " p=" + list(m.position()) +
         " q_wxyz=" + list(m.attitude()) + " cov0=" + std::to_string(m.covariance()[0]);
}
std::string show(const fiducap::dds::Tag& m) {
  return "id=" + std::to_string(m.id()) + " edge=" + std::to_string(m.edge_m()) +
         " p=" + list(m.position());
}

class AnyReader {
 public:
  virtual ~AnyReader() = default;
  virtual void report() = 0;
};

template <typename T, typename Support>
class TopicReader final : public AnyReader, public dds::DataReaderListener {
 public:
  TopicReader(dds::DomainParticipant& participant, dds::Subscriber& subscriber, WantedTopic wanted)
      : wanted_(std::move(wanted)), type_(new Support()) {
    // Cyclone DDS 0.10 refuses announcements with Fast DDS 2.9's type information.
    type_->auto_fill_type_information(false);
    type_->auto_fill_type_object(false);
    type_.register_type(&participant);
    auto* topic =
        participant.create_topic(wanted_.name, type_.get_type_name(), dds::TOPIC_QOS_DEFAULT);
    dds::DataReaderQos qos;
    qos.reliability().kind =
        wanted_.has('b') ? dds::BEST_EFFORT_RELIABILITY_QOS : dds::RELIABLE_RELIABILITY_QOS;
    if (wanted_.has('k')) qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
    if (wanted_.has('d')) qos.deadline().period = {0, 10'000'000};
    qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 100;
    qos.resource_limits().max_samples_per_instance = 100;
    qos.resource_limits().max_instances = 200;
    qos.resource_limits().max_samples = 20'000;
    reader_ = subscriber.create_datareader(topic, qos, this);
  }

  void on_data_available(dds::DataReader* reader) override {
    T message;
    dds::SampleInfo info;
    while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
      const std::lock_guard lock(mutex_);
      if (!info.valid_data) continue;
      ++count_;
      if (wanted_.has('l')) {  // live: a line for each message
        std::puts(wanted_.name.c_str());
        std::fflush(stdout);
      }
      if constexpr (requires { message.id(); }) ids_.insert(message.id());
      last_ = show(message);
    }
  }
  void on_requested_incompatible_qos(dds::DataReader*,
                                     const dds::RequestedIncompatibleQosStatus& s) override {
    const std::lock_guard lock(mutex_);
    incompatible_ = static_cast<int>(s.last_policy_id);
  }

  void report() override {
    const std::lock_guard lock(mutex_);
    std::printf("%s count=%zu ids=%zu incompatible=%d last: %s\n", wanted_.name.c_str(), count_,
                ids_.size(), incompatible_, last_.c_str());
  }

 private:
  WantedTopic wanted_;
  dds::TypeSupport type_;
  dds::DataReader* reader_{};
  std::mutex mutex_;
  std::size_t count_{0};
  std::set<long> ids_;
  int incompatible_{0};
  std::string last_;
};

using Maker = std::unique_ptr<AnyReader> (*)(dds::DomainParticipant&, dds::Subscriber&,
                                             const WantedTopic&);

template <typename T, typename Support>
std::unique_ptr<AnyReader> make(dds::DomainParticipant& participant, dds::Subscriber& subscriber,
                                const WantedTopic& wanted) {
  return std::make_unique<TopicReader<T, Support>>(participant, subscriber, wanted);
}

const std::map<std::string, Maker>& makers() {
  namespace geometry = geometry_msgs::msg::dds_;
  namespace nav = nav_msgs::msg::dds_;
  namespace tf2 = tf2_msgs::msg::dds_;
  namespace tracking = motion_capture_tracking_interfaces::msg::dds_;
  namespace mocap = mocap4r2_msgs::msg::dds_;
  namespace diagnostic = diagnostic_msgs::msg::dds_;
  namespace px4 = px4_msgs::msg::dds_;
  static const std::map<std::string, Maker> all{
      {"PoseStamped", make<geometry::PoseStamped_, geometry::PoseStamped_PubSubType>},
      {"TwistStamped", make<geometry::TwistStamped_, geometry::TwistStamped_PubSubType>},
      {"Odometry", make<nav::Odometry_, nav::Odometry_PubSubType>},
      {"TFMessage", make<tf2::TFMessage_, tf2::TFMessage_PubSubType>},
      {"NamedPoseArray", make<tracking::NamedPoseArray_, tracking::NamedPoseArray_PubSubType>},
      {"RigidBodies", make<mocap::RigidBodies_, mocap::RigidBodies_PubSubType>},
      {"DiagnosticArray",
       make<diagnostic::DiagnosticArray_, diagnostic::DiagnosticArray_PubSubType>},
      {"VehicleOdometry", make<px4::VehicleOdometry_, px4::VehicleOdometry_PubSubType>},
      {"Body", make<fiducap::dds::Body, fiducap::dds::BodyPubSubType>},
      {"Tag", make<fiducap::dds::Tag, fiducap::dds::TagPubSubType>},
  };
  return all;
}

}  // namespace

int read_topics(dds::DomainParticipant& participant, const std::vector<WantedTopic>& topics,
                Seconds duration) {
  auto* subscriber = participant.create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  std::vector<std::unique_ptr<AnyReader>> readers;
  for (const auto& wanted : topics) {
    const auto maker = makers().find(wanted.type);
    if (maker == makers().end()) {
      std::fprintf(stderr, "no type %s\n", wanted.type.c_str());
      return 2;
    }
    readers.push_back(maker->second(participant, *subscriber, wanted));
  }
  std::this_thread::sleep_for(duration);
  for (const auto& reader : readers) reader->report();
  std::fflush(stdout);
  // Listeners are called until the readers are gone.
  participant.delete_contained_entities();
  return 0;
}

}  // namespace fast_dds_peer
